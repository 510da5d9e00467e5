"""Logs that hold the motion of another log again: saved with other line ends, digits or rows, as a part or a whole.

One arm has one pose at a time. A log of the same seconds with the same poses is a copy, however it was written; its
power would be counted twice, and a copy of a training log among the test logs makes errors look small. A program that
is run again is no copy: its times are others, or, where they count from the start of a log, what was measured.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from acqd.errors import InputError
from acqd.robot.log import RobotLog, in_time
from acqd.timestamps import SINCE_1970_S

_SAME = 0.001
"""rad or m between angles of the same time."""
_MOST = 0.5
"""Share of the shorter log, as recorders that start a new file overlap by seconds; and of the way in both."""
_FEWEST = 20
"""Rows in common."""
_MEASURED = ("q", "qd", "tau", "current", "temperature", "power", "voltage")


@dataclass
class DistinctLogs:
    """Logs of one robot, no two of which hold the same motion."""

    _logs: list[tuple[RobotLog, float, float]] = field(default_factory=list)
    """With the first and the last time [s] of each."""

    def add(self, log: RobotLog) -> None:
        """Raises InputError for a log with the motion of one that was added."""
        time, _ = in_time(log)
        if len(time) < _FEWEST:
            return
        first, last = float(time[0]), float(time[-1])
        for other, from_s, to_s in self._logs:
            if min(first, from_s) < SINCE_1970_S:  # from the start of a log: only equal rows tell
                copied = (first, last) == (from_s, to_s) and _equal(log, other)
            else:
                shared_s = min(last, to_s) - max(first, from_s)
                copied = shared_s > _MOST * min(last - first, to_s - from_s) and _together(log, other)
            if copied:
                raise InputError(
                    log.path, f"holds the same motion at the same times as {other.path.name}: leave one of them out"
                )
        self._logs.append((log, first, last))


def _equal(log: RobotLog, other: RobotLog) -> bool:
    """Whether all that both logs measured is equal in all rows, and some of it changes."""
    (time, rows), (times, others) = in_time(log), in_time(other)
    if not np.array_equal(time, times):
        return False
    both = [(getattr(log, name), getattr(other, name)) for name in _MEASURED]
    pairs = [(one[rows], two[others]) for one, two in both if one is not None and two is not None]
    changes = any(np.ptp(one, axis=0).any() for one, _ in pairs)
    return changes and all(np.array_equal(one, two, equal_nan=True) for one, two in pairs)


def _together(log: RobotLog, other: RobotLog) -> bool:
    """Whether the arm moves through the same poses at the same times; two logs of an arm at rest have one pose, too."""
    (time, rows), (times, others) = in_time(log), in_time(other)
    if log.q.shape[1] != other.q.shape[1]:
        return False
    common = rows[(time >= times[0]) & (time <= times[-1])]
    if len(common) < _FEWEST or np.ptp(log.q[common], axis=0).max() < 10 * _SAME:
        return False
    there = np.column_stack([np.interp(log.time[common], times, angle) for angle in other.q[others].T])
    same = np.abs(there - log.q[common]).max(axis=1) < _SAME
    way = np.abs(np.gradient(log.q[common], axis=0)).sum(axis=1)
    return bool(way[same].sum() > _MOST * way.sum())
