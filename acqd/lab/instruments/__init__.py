"""Instruments of the virtual cell: mains and meter, the PLC at full speed, data recorder, row file."""
