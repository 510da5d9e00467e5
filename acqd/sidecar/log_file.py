"""One robot log as a file: checks before any work, and its rows in pieces, so that no log is too long for memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog, in_time
from acqd.sidecar.log_pieces import portions, with_neighbours

_LATEST_S, _LONGEST_S = 4e9, 6 * 3600.0


@dataclass(frozen=True, slots=True)
class LogFile:
    """A log that was read once; `pieces` reads it again unless it is one piece."""

    path: Path
    span_s: tuple[float, float]
    """First and last controller time [s]."""
    moving: RobotLog
    """The piece with the most motion, of about ten minutes, or all of a shorter log."""
    note: str
    """What a user should know: that the last line is cut off; empty if it is whole."""
    _file: BinaryIO
    _robot: RobotDescription
    _whole: bool
    """Whether `moving` is the whole log."""

    def pieces(self, margin_s: float) -> Iterator[RobotLog]:
        """All rows in pieces of at most about ten minutes, each with `margin_s` of its neighbours as context."""
        if self._whole:
            yield self.moving
        else:
            self._file.seek(0)
            yield from with_neighbours(portions(self.path, self._file, self._robot), margin_s)


def open_log(path: Path, file: BinaryIO, robot: RobotDescription, axes: int) -> LogFile:
    """Checks a log of `axes` joints with Unix times and at most 6 h. Raises UserError, InputError."""
    moving, most, count, start_s, end_s, note = None, -1.0, 0, np.inf, -np.inf, ""
    for piece in with_neighbours(portions(path, file, robot), 0.0):
        if piece.q.shape[1] != axes:
            raise InputError(path, f"has {piece.q.shape[1]} axes, the model {axes}")
        begin, end = span_of(piece)
        note = piece.note or note
        start_s, end_s, count = min(start_s, begin), max(end_s, end), count + 1
        if not (start_s >= 0 and end_s < _LATEST_S):
            raise InputError(path, f"times from {start_s:.4g} to {end_s:.4g} s are not Unix times")
        if end_s - start_s > _LONGEST_S:
            raise InputError(path, f"is {(end_s - start_s) / 3600:.1f} h long; a log of at most 6 h is expected")
        amount = float(np.abs(np.diff(piece.q, axis=0)).sum())
        if amount > most:
            moving, most = piece, amount
    assert moving is not None  # a file without rows raises InputError
    return LogFile(path, (start_s, end_s), moving, note, file, robot, count == 1)


def span_of(log: RobotLog) -> tuple[float, float]:
    """First and last controller time [s]."""
    stamps, _ = in_time(log)
    return float(stamps[0]), float(stamps[-1])


def printable(text: str) -> str:
    """The text as one line of valid UTF-8, different for different texts; names of files may be any bytes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
