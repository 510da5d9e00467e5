"""Checks that columns belong to the axes: torques and currents to the angles of a log, and the order of all of them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.axis_order import OrderJudgement, OrderSample, judge_order, pieces
from acqd.dataset.merge import Recording
from acqd.dataset.regressors import best_torque
from acqd.errors import InputError, UserError
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inverse_dynamics
from acqd.robot.log import RobotLog, in_time

Sample: TypeAlias = tuple[str, Floats, Floats]

_LOGS_CHECKED = 6
_MIN_DEVIATION_NM = 2.0  # standard deviation; joints with less are not compared
_MIN_CORRELATION = 0.6  # of logged with computed torque, median over the joints
_CLEARLY = 0.2
"""Median correlation that an exchange must gain: two joints that move alike gain 0.17 in a real log of a Gen3."""
_THINNED = 3
"""Every third row is compared: neighbours tell the same."""
_STEP_S = 0.04


def judge_logs(logs: list[RobotLog], robot: RobotDescription) -> OrderJudgement | None:
    """The order of the axes by the torques or currents of all logs together; None without such columns.

    Raises UserError when all logs together fit the robot clearly better in another order.
    A single log may miss an exchange that ten logs show: each moves other joints.
    """
    some = [log for log in logs[:: -(-len(logs) // _LOGS_CHECKED)] if len(log.time) > 1]
    samples = [sample for log in some if (sample := _sample(log, robot)) is not None]
    if not samples:
        return None
    judged = _judged(robot, samples)
    if judged.better is not None:
        many = f"{logs[0].path.parent}: in its {len(logs)} logs" if len(logs) > 1 else f"{logs[0].path}"
        raise UserError(f"{many}, angles and {samples[0][0]} do not fit as logged: {judged.text(robot)}")
    return judged


def judge_recordings(
    recordings: list[Recording], robot: RobotDescription, by_torque: OrderJudgement | None
) -> list[str]:
    """Lines on axes whose order neither the torques nor the power of recordings confirm.

    Raises UserError when the power fits the robot clearly better in another order. `by_torque`: what torques say.
    """
    if by_torque is not None and not by_torque.unsure:
        return []
    some = recordings[:: -(-len(recordings) // _LOGS_CHECKED)]
    samples = [piece for recording in some for piece in _power_pieces(recording, robot.axes)]
    judged = judge_order(robot, samples)
    if judged.better is not None and (by_torque is None or judged.better in by_torque.unsure):
        raise UserError(f"angles and power of {len(recordings)} recordings do not fit as logged: {judged.text(robot)}")
    judged = judged if by_torque is None else by_torque.together(judged)
    witness = "by their power" if by_torque is None else "by their torques, currents and power"
    return [note] if (note := judged.note(robot, witness)) else []


def _power_pieces(recording: Recording, axes: int) -> Iterator[OrderSample]:
    q = np.column_stack([recording.columns[f"q{axis + 1}"] for axis in range(axes)])
    step_s = float(np.median(np.diff(recording.time_ns))) * 1e-9
    return pieces(q, recording.columns["P"], recording.valid, step_s)


def _judged(robot: RobotDescription, samples: list[Sample]) -> OrderJudgement:
    guessed = samples[0][0] == "currents" and any(joint.guesses_drive for joint in robot.joint)
    long = [piece for _, q, seen in samples for piece in pieces(q, seen, np.ones(len(q), bool), _STEP_S)]
    return judge_order(robot, long, guessed=guessed)


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
    agreement = _agreement(robot, q, logged)
    if len(agreement) < 2 or np.median(list(agreement.values())) >= _MIN_CORRELATION:
        return
    exchanged = _exchanged(robot, q, logged, float(np.median(list(agreement.values()))) + _CLEARLY)
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


def _sample(log: RobotLog, robot: RobotDescription) -> Sample | None:
    """The name of what stands for torques, angles and torques [T, axes] at even times; None without torques."""
    name, known = _torques(log, robot)
    if known is None:
        return None
    time, rows = in_time(log)
    grid = np.arange(time[0], time[-1], _STEP_S)
    return name, _on_grid(grid, time, log.q[rows]), _on_grid(grid, time, known[rows])


def _exchanged(robot: RobotDescription, q: Floats, logged: Floats, least: float) -> str:
    """Which two axes of the angles, exchanged, make angles and torques agree, by `least` at least; empty if none do."""
    for one, other in itertools.combinations(range(robot.axes), 2):
        order = np.arange(robot.axes)
        order[[one, other]] = other, one
        agreement = _agreement(robot, q[:, order], logged)
        if len(agreement) > 1 and np.median(list(agreement.values())) >= max(_MIN_CORRELATION, least):
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
