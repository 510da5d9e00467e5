"""Rows for a spool, and all that a spool holds."""

from __future__ import annotations

from acqd.telemetry.spool import SpooledRow, Stream

STREAMS = [Stream("cell1", channel, "boot1") for channel in ("L1", "total")]


def window(k, size=40):
    return [SpooledRow(stream, k, b"%d:" % k + b"x" * size) for stream in STREAMS]


def everything(spool):
    rows, position = [], spool.start
    while position != spool.end:
        some, position = spool.read(position, 7, lambda stream, seq: True)
        rows += some
    return rows
