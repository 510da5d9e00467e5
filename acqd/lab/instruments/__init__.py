"""Instruments of the virtual cell: mains and meter, the PLC at full speed, the data recorder, the row file."""
