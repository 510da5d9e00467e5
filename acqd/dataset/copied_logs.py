"""Logs that hold the motion of another log again: saved with other line ends, digits or rows, as a part or a whole.

One arm has one pose at a time. A log of the same seconds with the same poses is a copy, however it was written; its
power would be counted twice, and a copy of a training log among the test logs makes errors look small.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from acqd.errors import InputError
from acqd.robot.log import RobotLog, in_time

_SAME = 0.001
"""rad or m between angles of the same time."""
_UNIX_S = 1e8
"""Times above are of a calendar (after 1973). Smaller ones count from the start of a log: then only equal rows tell."""
_MOST = 0.5
"""Share of the shorter log: recorders that start a new file overlap by seconds."""
_FEWEST = 20
"""Rows in common."""


def require_new(log: RobotLog, others: Iterable[RobotLog]) -> None:
    """Raises InputError for a log with the motion of one of the others."""
    for other in others:
        if log.q.shape[1] == other.q.shape[1] and _copied(log, other):
            raise InputError(
                log.path, f"holds the same motion at the same times as {other.path.name}: leave one of them out"
            )


def _copied(log: RobotLog, other: RobotLog) -> bool:
    (time, rows), (times, others) = in_time(log), in_time(other)
    if len(time) < _FEWEST or len(times) < _FEWEST:
        return False
    if min(time[0], times[0]) < _UNIX_S:
        return bool(np.array_equal(time, times) and np.array_equal(log.q[rows], other.q[others]))
    first, last = max(time[0], times[0]), min(time[-1], times[-1])
    if last - first <= _MOST * min(np.ptp(time), np.ptp(times)):
        return False
    common = rows[(time >= first) & (time <= last)]
    if len(common) < _FEWEST or np.ptp(log.q[common], axis=0).max() < 10 * _SAME:
        return False  # two arms at rest may have one pose
    there = np.column_stack([np.interp(log.time[common], times, angle) for angle in other.q[others].T])
    return bool(np.median(np.abs(there - log.q[common]).max(axis=1)) < _SAME)
