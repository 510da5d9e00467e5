"""One robot log as a file: its content hash, its printable name, and checks before any work."""

from __future__ import annotations

import hashlib
from pathlib import Path

from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog, in_time, read_log

_LATEST_S, _LONGEST_S = 4e9, 6 * 3600.0


def open_log(path: Path, robot: RobotDescription, axes: int) -> RobotLog:
    """Reads a log of `axes` joints with Unix times and at most 6 h. Raises UserError, InputError."""
    log = read_log(path, robot)
    if log.note:  # a result says nothing about rows left out, so that there is none
        raise InputError(path, log.note)
    start_s, end_s = span_of(log)
    if not (start_s >= 0 and end_s < _LATEST_S):
        raise InputError(path, f"times from {start_s:.4g} to {end_s:.4g} s are not Unix times")
    if end_s - start_s > _LONGEST_S:
        raise InputError(path, f"is {(end_s - start_s) / 3600:.1f} h long; a log of at most 6 h is expected")
    if log.q.shape[1] != axes:
        raise InputError(path, f"has {log.q.shape[1]} axes, the model {axes}")
    return log


def span_of(log: RobotLog) -> tuple[float, float]:
    """First and last controller time [s]."""
    stamps, _ = in_time(log)
    return float(stamps[0]), float(stamps[-1])


def hash_of(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def printable(text: str) -> str:
    """The text as one line of valid UTF-8, different for different texts; names of files may be any bytes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
