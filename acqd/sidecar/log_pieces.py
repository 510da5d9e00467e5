"""A long log in pieces: each is checked like a log, and knows the rows of its neighbours around its own span."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.last_line import LEFT_OUT
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import log_of
from acqd.robot.table_text import Table, joined, text_tables

_CELLS = 1_000_000
"""Numbers of a portion: 8 MB. Of the usual log of 400 s, 40 columns and 125 Hz, there are two."""
_LONGEST_S = 600.0
_BACK_S = 0.25
"""Time by which rows around the edge of two portions may be out of order."""
_COLUMNS = ("time", "q", "qd", "tau", "current", "temperature", "power", "voltage")


def portions(path: Path, file: BinaryIO, robot: RobotDescription) -> Iterator[RobotLog]:
    """The log in `file` in portions of about a million numbers, in the order of time. Raises InputError, UserError.

    A log with garbled rows is refused: a result would say nothing about rows left out. A last line that is cut off
    is no such row: the note of the last portion says so.
    """
    latest_s, last = -np.inf, None
    turning = np.array([not joint.slides for joint in robot.joint])
    for table in _tables(path, file):
        if table.broken:
            row = min(table.broken)
            raise InputError(path, f"row {table.line(row)} {table.broken[row]}")
        log = log_of(path, table, robot)
        if log.note not in ("", LEFT_OUT):
            raise InputError(path, log.note)
        begin_s, end_s = float(log.time.min()), float(log.time.max())
        if begin_s < latest_s - _BACK_S:
            back = f"time goes back from {latest_s:.3f} to {begin_s:.3f} s"
            raise InputError(path, f"after row {table.line(0)}: {back}: write one file per recording")
        latest_s = max(latest_s, end_s)
        if last is not None:  # a portion is unwrapped alone: whole turns may lie between two of them
            turns = np.where(turning, np.rint((log.q[0] - last) / (2 * np.pi)), 0.0)
            log = replace(log, q=log.q - 2 * np.pi * turns)
        last = log.q[-1]
        yield log


def _tables(path: Path, file: BinaryIO) -> Iterator[Table]:
    waiting: list[Table] = []
    cells = 0
    for table in text_tables(path, file):
        waiting.append(table)
        cells += table.values.size
        if cells >= _CELLS:
            yield joined(waiting)
            waiting, cells = [], 0
    if waiting:
        yield joined(waiting)


def with_neighbours(logs: Iterable[RobotLog], margin_s: float) -> Iterator[RobotLog]:
    """Pieces of at most ten minutes; `core` is a piece's own span, rows within `margin_s` around it come from others.

    One piece alone has no core.
    """
    before: RobotLog | None = None
    current: RobotLog | None = None
    for following in logs:
        if current is not None:
            yield from _pieces(before, current, following, margin_s)
        before, current = current, following
    if current is not None:
        yield from _pieces(before, current, None, margin_s)


def _pieces(before: RobotLog | None, log: RobotLog, after: RobotLog | None, margin_s: float) -> Iterator[RobotLog]:
    begin_s = float(log.time.min()) if before is None else max(float(log.time.min()), float(before.time.max()))
    end_s = float(log.time.max()) if after is None else max(float(log.time.max()), float(after.time.min()))
    count = math.ceil((end_s - begin_s) / _LONGEST_S) if end_s - begin_s < 1e6 else 1
    if before is None and after is None and count <= 1:
        yield log
        return
    neighbours = [
        log if other is log else other.part(np.abs(other.time - edge_s) <= margin_s, other.path)
        for other, edge_s in ((before, begin_s), (log, begin_s), (after, end_s))
        if other is not None
    ]
    whole = _concatenated(neighbours)
    edges = np.linspace(begin_s, end_s, max(count, 1) + 1).tolist()
    for start, end in pairwise(edges):
        rows = (whole.time >= start - margin_s) & (whole.time <= end + margin_s)
        if rows.any():
            yield replace(whole.part(rows, log.path), core=(start, end))


def _concatenated(logs: list[RobotLog]) -> RobotLog:
    """Quantities that some portion lacks are left out; all portions of a file have the same columns."""
    values: dict[str, Any] = {}
    for name in _COLUMNS:
        columns = [getattr(log, name) for log in logs]
        values[name] = None if any(column is None for column in columns) else np.concatenate(columns)
    signals = {name: np.concatenate([log.signals[name] for log in logs]) for name in logs[0].signals}
    return replace(logs[0], signals=signals, note=logs[-1].note, **values)
