"""A check that a log's torque or current columns belong to its angle columns: against computed torques."""

from __future__ import annotations

import itertools
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.regressors import best_torque
from acqd.errors import InputError, UserError
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inverse_dynamics
from acqd.robot.log import RobotLog, in_time

Order: TypeAlias = tuple[int, ...]
"""For each axis, the column that holds its values."""
Sample: TypeAlias = tuple[str, Floats, Floats]

_LOGS_CHECKED = 6
_MIN_DEVIATION_NM = 2.0  # standard deviation; joints with less are not compared
_MIN_CORRELATION = 0.6  # of logged with computed torque, median over the joints
_CLEARLY = 0.2
"""Mean correlation by which another order must be better than the columns as logged. The real recordings
of a UR10e reach 0.64 to 0.98, 0.30 to 0.46 with two joints exchanged, and no exchange gains more than 0.11.
"""
_CLEARLY_TOGETHER, _SEVERAL = 0.1, 3
"""The same for the mean of several logs. Of the real recordings, no order gains more than 0.02 together."""
_MOST = 0.8
"""Share of the logs that must fit better."""
_WELL = 0.85
"""Score as logged from which on no other order is tried."""
_ALIKE = 0.05
_THINNED = 3
"""Every third row is compared: neighbours tell the same."""
_PER_AXIS = 0.05  # an exchange that explains more joints is preferred
_STEP_S = 0.04


def check_order(logs: list[RobotLog], robot: RobotDescription) -> None:
    """Raises UserError when all logs together fit the robot clearly better in another order of the axes.

    A single log may miss an exchange that ten logs show: each moves other joints.
    """
    some = [log for log in logs[:: -(-len(logs) // _LOGS_CHECKED)] if len(log.time) > 1]
    samples = [sample for log in some if (sample := _sample(log, robot)) is not None]
    order = _better_order(robot, samples)
    if order is not None:
        raise UserError(f"{logs[0].path.parent}: in its {len(logs)} logs, {_order_text(robot, samples, order)}")


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
    they agree with them in another order of the axes.
    """
    sample = _sample(log, robot)
    if sample is None:
        return
    name, q, logged = sample
    order = _better_order(robot, [sample])
    if order is not None:
        raise InputError(log.path, _order_text(robot, [sample], order))
    agreement = _agreement(robot, q, logged)
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
    some = slice(None, None, _THINNED)
    computed = inverse_dynamics(robot, q[some], qd[some], np.gradient(qd, _STEP_S, axis=0)[some])
    logged = logged[some]
    moving = np.flatnonzero((logged.std(axis=0) > _MIN_DEVIATION_NM) & (computed.std(axis=0) > _MIN_DEVIATION_NM))
    return {k: abs(float(np.corrcoef(logged[:, k], computed[:, k])[0, 1])) for k in moving.tolist()}


def _score(agreement: dict[int, float]) -> float:
    """Mean correlation of the axes that move."""
    return float(np.mean(list(agreement.values()))) if agreement else 0.0


def _better_order(robot: RobotDescription, samples: list[Sample]) -> Order | None:
    """The order of the columns, of angles and torques alike, that fits the robot clearly better; None for as logged.

    Of orders that fit alike, the one that moves the fewest columns.
    """
    as_logged = tuple(range(robot.axes))
    before = _scores(robot, samples, as_logged)
    if not len(before) or before.mean() > _WELL:
        return None
    clearly = _CLEARLY if len(samples) < _SEVERAL else _CLEARLY_TOGETHER
    better: list[tuple[float, Order]] = []
    for order in _orders(robot.axes):
        scores = _scores(robot, samples, order)
        if len(scores) != len(before) or (scores > before).mean() < _MOST:
            continue
        if scores.mean() > before.mean() + clearly:
            better.append((float(scores.mean()), order))
    if not better:
        return None
    best = max(score for score, _ in better)
    alike = [(score, order) for score, order in better if score > best - _ALIKE]
    return min(alike, key=lambda each: (_moved(each[1]), -each[0]))[1]


def _orders(axes: int) -> list[Order]:
    """Orders in which two columns are exchanged or three are cycled."""
    orders = []
    for count in (2, 3):
        for chosen in itertools.combinations(range(axes), count):
            for turn in range(1, count):
                order = list(range(axes))
                for k, axis in enumerate(chosen):
                    order[axis] = chosen[(k + turn) % count]
                orders.append(tuple(order))
    return orders


def _moved(order: Order) -> int:
    return sum(axis != column for axis, column in enumerate(order))


def _scores(robot: RobotDescription, samples: list[Sample], order: Order) -> Floats:
    """Score of each log with its columns in `order`; logs of which fewer than two joints can be compared count not."""
    index = np.array(order)
    found = [_agreement(robot, q[:, index], logged[:, index]) for _, q, logged in samples]
    return np.array([_score(each) + _PER_AXIS * len(each) - _PER_AXIS * robot.axes for each in found if len(each) > 1])


def _order_text(robot: RobotDescription, samples: list[Sample], order: Order) -> str:
    moved = [axis for axis, column in enumerate(order) if axis != column]
    names = [robot.joint[axis].name for axis in moved]
    if len(moved) == 2:
        what = f"with {names[0]} and {names[1]} exchanged"
    else:
        columns = ", ".join(f"{robot.joint[axis].name} from column {order[axis] + 1}" for axis in moved)
        what = f"with {columns}"
    score = np.mean([_score(_agreement(robot, q, logged)) for _, q, logged in samples])
    return (
        f"angles and {samples[0][0]} fit {robot.name} better {what} (correlation {score:.2f} as logged): the columns "
        "of these joints are in another order, as in messages that sort joints by name; write them in the order of "
        "the axes"
    )


def _sample(log: RobotLog, robot: RobotDescription) -> Sample | None:
    """The name of what stands for torques, angles and torques [T, axes] at even times; None without torques."""
    name, known = _torques(log, robot)
    if known is None:
        return None
    time, rows = in_time(log)
    grid = np.arange(time[0], time[-1], _STEP_S)
    return name, _on_grid(grid, time, log.q[rows]), _on_grid(grid, time, known[rows])


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
