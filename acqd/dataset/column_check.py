"""A check that a log's torque or current columns belong to its angle columns: against computed torques."""

from __future__ import annotations

import itertools

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
_CLEARLY, _LEAST_SCORE = 0.2, 0.55
"""Mean correlation by which an exchange must be better than the columns as logged, and that it must have. The real
recordings of a UR10e reach 0.64 to 0.98, 0.30 to 0.46 with two joints exchanged, and no exchange gains more than 0.11.
"""
_PER_AXIS = 0.05  # an exchange that explains more joints is preferred
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
    """Raises InputError when logged torques contradict the logged angles.

    Currents stand in for torques that were not logged. Friction bends them, so that they contradict the angles only if
    they agree with them once two axes are exchanged.
    """
    name, known = _torques(log, robot)
    if known is None:
        return
    time, rows = in_time(log)
    grid = np.arange(time[0], time[-1], _STEP_S)
    q, logged = _on_grid(grid, time, log.q[rows]), _on_grid(grid, time, known[rows])
    agreement = _agreement(robot, q, logged)
    order = _better_order(robot, q, logged, agreement)
    if order is not None:
        one, other = (robot.joint[axis].name for axis in order)
        raise InputError(
            log.path,
            f"angles and {name} fit {robot.name} better with {one} and {other} exchanged (correlation "
            f"{_score(agreement):.2f} as logged): the columns of these joints are in another order, as in messages "
            "that sort joints by name; write them in the order of the axes",
        )
    if len(agreement) < 2 or np.median(list(agreement.values())) >= _MIN_CORRELATION:
        return
    exchanged = _exchanged(robot, q, logged)
    if name == "currents" and not exchanged:
        return
    worst = min(agreement, key=lambda axis: agreement[axis])
    raise InputError(
        log.path,
        f"the {name} do not belong to the angles (worst joint {robot.joint[worst].name}, correlation "
        f"{agreement[worst]:.2f}{exchanged}): are the columns in the order of {robot.name}'s axes?",
    )


def _agreement(robot: RobotDescription, q: Floats, logged: Floats) -> dict[int, float]:
    """Correlation of logged with computed torque of the axes that move."""
    qd = np.gradient(q, _STEP_S, axis=0)
    computed = inverse_dynamics(robot, q, qd, np.gradient(qd, _STEP_S, axis=0))
    moving = np.flatnonzero((logged.std(axis=0) > _MIN_DEVIATION_NM) & (computed.std(axis=0) > _MIN_DEVIATION_NM))
    return {k: abs(float(np.corrcoef(logged[:, k], computed[:, k])[0, 1])) for k in moving.tolist()}


def _score(agreement: dict[int, float]) -> float:
    """Mean correlation of the axes that move."""
    return float(np.mean(list(agreement.values()))) if agreement else 0.0


def _better_order(
    robot: RobotDescription, q: Floats, logged: Floats, agreement: dict[int, float]
) -> tuple[int, int] | None:
    """Two axes whose columns, of angles and torques alike, fit the robot clearly better once they are exchanged."""
    if len(agreement) < 2:
        return None
    best, best_score = None, 0.0
    for one, other in itertools.combinations(range(robot.axes), 2):
        order = np.arange(robot.axes)
        order[[one, other]] = other, one
        exchanged = _agreement(robot, q[:, order], logged[:, order])
        clearly = _score(exchanged) > max(_score(agreement) + _CLEARLY, _LEAST_SCORE)
        score = _score(exchanged) + _PER_AXIS * len(exchanged)
        if len(exchanged) > 1 and clearly and score > best_score:
            best, best_score = (one, other), score
    return best


def _exchanged(robot: RobotDescription, q: Floats, logged: Floats) -> str:
    """Which two axes, exchanged, make angles and torques agree; empty if none do."""
    for one, other in itertools.combinations(range(robot.axes), 2):
        order = np.arange(robot.axes)
        order[[one, other]] = other, one
        agreement = _agreement(robot, q[:, order], logged)
        if len(agreement) > 1 and np.median(list(agreement.values())) >= _MIN_CORRELATION:
            return f"; with {robot.joint[one].name} and {robot.joint[other].name} exchanged they do"
    return ""


def _torques(log: RobotLog, robot: RobotDescription) -> tuple[str, Floats | None]:
    """[T, axes] Nm at the joints: logged, or the nominal torque of the logged currents; None without either."""
    if best_torque(log) == "measured":
        return "torques", log.tau
    if log.current is None or not np.isfinite(log.current).all():
        return "currents", None
    return "currents", log.current * np.array([joint.drive.effort_per_ampere for joint in robot.joint])


def _on_grid(grid: Floats, time: Floats, values: Floats) -> Floats:
    return np.column_stack([np.interp(grid, time, column) for column in values.T])
