"""Rows that wait until they are delivered: a log of segments on disk, in memory where there is no folder."""

from acqd.telemetry.spool.log import confirm
from acqd.telemetry.spool.record import Energy, Readings, Stream
from acqd.telemetry.spool.spool import Limits, Position, Spool, SpooledRow, WhenFull

__all__ = ["Energy", "Limits", "Position", "Readings", "Spool", "SpooledRow", "Stream", "WhenFull", "confirm"]
