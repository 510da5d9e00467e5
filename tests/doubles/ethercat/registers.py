"""Addresses of the slave controller's registers (Beckhoff, "Hardware Data Sheet ET1100, Section II")."""

from __future__ import annotations

from struct import Struct
from typing import Final

U16: Final = Struct("<H")
U32: Final = Struct("<I")
U64: Final = Struct("<Q")

MEMORY_SIZE: Final = 0x3000
"""4 KiB of registers and 8 KiB of process memory [byte]."""

STATION: Final = 0x0010
DL_STATUS: Final = 0x0110
AL_CONTROL: Final = 0x0120
AL_STATUS: Final = 0x0130
AL_CODE: Final = 0x0134
ERROR_COUNTERS: Final = 0x0300
SII_CONTROL: Final = 0x0502
SII_ADDRESS: Final = 0x0504
SII_DATA: Final = 0x0508
FMMU: Final = 0x0600
FMMU_COUNT: Final = 8
SM: Final = 0x0800
SM_COUNT: Final = 8
DC_RECEIVE: Final = 0x0900
DC_SYSTEM: Final = 0x0910
DC_PROCESSING: Final = 0x0918
DC_OFFSET: Final = 0x0920
DC_DELAY: Final = 0x0928
DC_DIFFERENCE: Final = 0x092C
DC_ACTIVATION: Final = 0x0981
DC_START: Final = 0x0990
DC_CYCLE0: Final = 0x09A0
DC_CYCLE1: Final = 0x09A4

READ_ONLY: Final = (
    (0x0000, 0x0010),
    (DL_STATUS, DL_STATUS + 2),
    (AL_STATUS, AL_CODE + 2),
    (ERROR_COUNTERS, ERROR_COUNTERS + 0x14),
    (DC_RECEIVE, DC_OFFSET),
    (DC_DIFFERENCE, DC_DIFFERENCE + 4),
)
"""Ranges (first, end) that a master's write leaves as they are.

Among them the error counters, which a write clears and which are zero here, and the system time: a write to 0x0910
feeds the control loop of the clock, and all slaves of this segment share one oscillator.
"""
