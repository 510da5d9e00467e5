"""The times of a log as it is read: rows that share a stamp, stamps of a recorder, a clock that was set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.errors import InputError
from acqd.robot.clock_fault import set_back
from acqd.robot.description import RobotDescription
from acqd.robot.garbled import clock_restart
from acqd.robot.log import RobotLog
from acqd.robot.resolution import steps_of
from acqd.robot.row_clock import LateStamps, late_stamps
from acqd.robot.table import Table
from acqd.rounded_times import Rebuilt, rebuilt_times, shared_stamps

LATEST_S = 7_258_118_400.0
"""2200-01-01 in Unix seconds."""
_MS = 1e14
"""Unix time in ms is below, in us below a thousand times that."""
_WHOLE_S = 100.0
"""From which on tenths of a second are digits enough."""
_FEW_SHARED = 0.25
"""Share of rows up to which rows of one stamp can be spared."""


def rebuilt(log: RobotLog, robot: RobotDescription) -> tuple[RobotLog, Rebuilt | LateStamps | None]:
    """The log with times put right where its stamps share digits or are those of a recorder, and how.

    Raises InputError for times in another unit, and where the rate of rows that share a stamp is not regular.
    """
    usual = float(np.median(log.time))  # single stamps may be garbled
    if usual > LATEST_S:
        unit = "ms" if usual < _MS else "us" if usual < 1e3 * _MS else "ns"
        raise InputError(
            log.path, f"its times are about {usual:.4g} s; expected seconds before 2200: are they in {unit}?"
        )
    return _with_even_times(*_with_distinct_times(log), robot)


def require_one_clock(log: RobotLog, table: Table, robot: RobotDescription) -> None:
    """Raises InputError where the clock was set back in a log, or its times begin again."""
    back = set_back(log.time, log.q, robot.speed)
    if back is not None:
        by = log.time[back - 1] - log.time[back]
        back_s = f"{by:.1f}" if by > _WHOLE_S else f"{by:.3g}"
        raise InputError(
            log.path,
            f"row {table.line(back)}: the time goes back by {back_s} s while the arm moves on: the clock was set there "
            "(the end of summer time, say); cut the log at this row, or write UTC",
        )
    restart = clock_restart(log.time, log.q)
    if restart is not None:
        again = f"time goes back from {log.time[restart - 1]:.3f} to {log.time[restart]:.3f} s"
        raise InputError(
            log.path, f"row {table.line(restart)}: {again} with other angles: write one file per recording"
        )


def _with_distinct_times(log: RobotLog) -> tuple[RobotLog, Rebuilt | None]:
    """The log with the times of rows that share a stamp put at their distances, and how.

    Raises InputError where the rate of such rows is not regular.
    """
    if not np.isfinite(log.time).all():
        return log, None
    origin = float(np.median(log.time))  # the first time may be garbled
    since = log.time - origin
    shared = shared_stamps(since, (log.q[1:] != log.q[:-1]).any(axis=1))
    if not shared:
        return log, None
    rebuilt = rebuilt_times(since, shared)
    few = shared < _FEW_SHARED * len(since)
    if few and (rebuilt is None or rebuilt.stamp_s == 0.0):
        return log, None  # digits about as wide as the rows: one row of each stamp is used, and its time is doubted
    if rebuilt is None:
        raise InputError(
            log.path,
            f"{shared} of {len(since)} rows have the time of the row before with other angles, and their rate is not "
            "regular: are times written with too few digits? Expected times with three decimals or more",
        )
    return replace(log, time=origin + rebuilt.time), rebuilt


def _with_even_times(
    log: RobotLog, rebuilt: Rebuilt | None, robot: RobotDescription
) -> tuple[RobotLog, Rebuilt | LateStamps | None]:
    """The log with the times of the controller's rate where the stamps are those of a recorder, and how."""
    good = np.flatnonzero(np.isfinite(log.time) & np.isfinite(log.q).all(axis=1))
    if rebuilt is not None or len(good) < 2:
        return log, rebuilt
    rows = good[np.unique(log.time[good], return_index=True)[1]]
    if not (np.diff(rows) > 0).all():  # rows that are not in order tell nothing of who stamped them
        return log, None
    origin = float(np.median(log.time[good]))
    late = late_stamps(log.time[rows] - origin, log.q[rows], robot.speed, steps_of(log.q[rows]))
    if late is None:
        return log, None
    time = log.time.copy()
    time[good] = origin + late.time[np.searchsorted(log.time[rows], log.time[good])]
    return replace(log, time=time), late
