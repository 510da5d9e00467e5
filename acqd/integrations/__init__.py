"""Other programs' view of the rows: each integration is a subscriber in a separate process.

Nothing here runs in the daemon, so that no integration can delay metering. Devices and channels are learned from the
messages that arrive.
"""
