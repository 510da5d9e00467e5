"""A check that a log's torque columns belong to its angle columns: logged against computed torques."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.regressors import best_torque
from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inverse_dynamics
from acqd.robot.log import RobotLog, in_time

_LOGS_CHECKED = 6
_MIN_DEVIATION_NM = 2.0  # standard deviation; joints with less are not compared
_MIN_CORRELATION = 0.6  # of logged with computed torque, median over the joints
_STEP_S = 0.04


def to_check(logs: list[RobotLog], robot: RobotDescription) -> list[RobotLog]:
    """Logs whose columns are to be checked: a few of them, and all if one of these is wrong."""
    some = logs[:: max(1, len(logs) // _LOGS_CHECKED)]
    try:
        for log in some:
            check_columns(log, robot)
    except InputError:
        return logs
    return []


def check_columns(log: RobotLog, robot: RobotDescription) -> None:
    """Raises InputError when logged torques contradict the logged angles."""
    if best_torque(log) != "measured":
        return
    time, rows = in_time(log)
    grid = np.arange(time[0], time[-1], _STEP_S)
    q = _on_grid(grid, time, log.q[rows])
    qd = np.gradient(q, _STEP_S, axis=0)
    assert log.tau is not None
    logged = _on_grid(grid, time, log.tau[rows])
    computed = inverse_dynamics(robot, q, qd, np.gradient(qd, _STEP_S, axis=0))
    moving = np.flatnonzero((logged.std(axis=0) > _MIN_DEVIATION_NM) & (computed.std(axis=0) > _MIN_DEVIATION_NM))
    if len(moving) < 2:
        return
    correlations = [abs(float(np.corrcoef(logged[:, k], computed[:, k])[0, 1])) for k in moving]
    if np.median(correlations) < _MIN_CORRELATION:
        worst = robot.joint[int(moving[int(np.argmin(correlations))])].name
        raise InputError(
            log.path,
            f"the torques do not belong to the angles (worst joint {worst}, correlation {min(correlations):.2f}): "
            f"are the columns in the order of {robot.name}'s axes?",
        )


def _on_grid(grid: Floats, time: Floats, values: Floats) -> Floats:
    return np.column_stack([np.interp(grid, time, column) for column in values.T])
