"""Whether a log's columns are what they say: torques must be those of the angles, speeds their derivatives."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.regressors import best_torque
from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog, in_time

_PROBED = 6  # logs
_MOVES_NM = 2.0
_LEAST_LIKE = 0.6  # correlation of logged with computed torque, in the middle of the joints
_STEP_S = 0.04


def check_columns(logs: list[RobotLog], robot: RobotDescription) -> None:
    """Raises InputError when logged torques contradict the logged angles."""
    try:
        from acqd.robot.arm import Arm
        from acqd.robot.dynamics import inverse_dynamics
    except ModuleNotFoundError:
        return  # without a robot library there is nothing to compare with
    arm = Arm(robot)
    for log in logs[:: max(1, len(logs) // _PROBED)]:
        if best_torque(log) != "measured":
            continue
        time, rows = in_time(log)
        grid = np.arange(time[0], time[-1], _STEP_S)
        q = _on(grid, time, log.q[rows])
        qd = np.gradient(q, _STEP_S, axis=0)
        assert log.tau is not None
        logged, computed = (
            _on(grid, time, log.tau[rows]),
            inverse_dynamics(arm, q, qd, np.gradient(qd, _STEP_S, axis=0)),
        )
        telling = np.flatnonzero((logged.std(axis=0) > _MOVES_NM) & (computed.std(axis=0) > _MOVES_NM))
        if len(telling) < 2:
            continue
        alike = [abs(float(np.corrcoef(logged[:, k], computed[:, k])[0, 1])) for k in telling]
        if np.median(alike) < _LEAST_LIKE:
            worst = robot.joint[int(telling[int(np.argmin(alike))])].name
            raise InputError(
                log.path,
                f"its torques are not those of its angles (least alike {worst}, correlation {min(alike):.2f}): "
                f"are the columns in the order of {robot.name}'s axes?",
            )


def _on(grid: Floats, time: Floats, values: Floats) -> Floats:
    return np.column_stack([np.interp(grid, time, column) for column in values.T])
