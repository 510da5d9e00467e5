"""Protocol doubles: devices that speak the wire, for tests and for the demonstrations in `tools/demo`.

A double proves our side of a protocol. It is no proof of the device that it stands for.
"""
