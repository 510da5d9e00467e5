"""Checks that columns belong to the axes: torques and currents to the angles of a log, and the order of all of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.align import MIN_R2
from acqd.dataset.axis_order import OrderJudgement, judge_order
from acqd.dataset.axis_zeros import judge_zeros
from acqd.dataset.merge import Recording
from acqd.dataset.order_fit import OrderSample, pieces, share_of, share_of_weight, shares_of
from acqd.dataset.other_robot import other_robot
from acqd.dataset.regressors import best_torque
from acqd.dataset.reversed_rows import reversed_rows
from acqd.errors import InputError, UserError
from acqd.report.digits import percent
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inverse_dynamics
from acqd.robot.log import RobotLog, in_time

Sample: TypeAlias = tuple[str, Floats, Floats]

_LOGS_CHECKED = 6
_MIN_DEVIATION_NM = 2.0  # standard deviation; joints with less are not compared
_LEAST_EXPLAINED = 0.36
"""Share of the variance of logged torques that masses, friction and rotors explain, in the median over the joints."""
_THINNED = 3
"""Every third row is compared: neighbours tell the same."""
_STEP_S = 0.04
_FEWEST_TO_COMPARE = 3
_WORSE = 1.5
"""Unexplained share of a log over that of the others, from which on the log is judged alone."""
_OTHER_UNIT = 3.0
"""Logged over computed torque that no description and no payload explains."""


def judge_logs(logs: list[RobotLog], robot: RobotDescription) -> OrderJudgement | None:
    """The order of the axes by the torques or currents of all logs together; None without such columns.

    Raises UserError when all logs together fit the robot clearly better in another order.
    A single log may miss an exchange that ten logs show: each moves other joints.
    """
    some = [log for log in logs[:: -(-len(logs) // _LOGS_CHECKED)] if len(log.time) > 1]
    samples = [sample for log in some if (sample := _sample(log, robot)) is not None]
    many = f"{logs[0].path.parent}: in its {len(logs)} logs" if len(logs) > 1 else f"{logs[0].path}"
    return _judged(robot, samples, many)


def doubt_robot(logs: list[RobotLog], robot: RobotDescription) -> list[str]:
    """A line if torques or currents of some logs are those of another shipped robot."""
    some = [log for log in logs[:: -(-len(logs) // _LOGS_CHECKED)] if len(log.time) > 1]
    samples = [sample for log in some if (sample := _sample(log, robot)) is not None]
    long = [piece for _, q, seen in samples for piece in pieces(q, seen, np.ones(len(q), bool), _STEP_S)]
    return [line] if long and (line := other_robot(robot, long)) else []


def check_each(logs: list[RobotLog], robot: RobotDescription) -> dict[Path, str]:
    """Of logs whose axes are in another order than those of the other logs: why.

    All logs together confirm the order by torques or currents; one that they explain much worse is judged alone.
    """
    reasons: dict[Path, str] = {}
    if len(logs) < _FEWEST_TO_COMPARE:
        return reasons
    samples = {k: sample for k, log in enumerate(logs) if (sample := _sample(log, robot)) is not None}
    long = {
        k: list(pieces(q, seen, np.ones(len(q), bool), _STEP_S)) for k, (_, q, seen) in samples.items() if len(q) > 1
    }
    guessed = {
        k: name == "currents" and any(j.guesses_drive for j in robot.joint) for k, (name, _, _) in samples.items()
    }
    explained = {k: share_of(robot, some, guessed=guessed[k]) for k, some in long.items() if some}
    if len(explained) < _FEWEST_TO_COMPARE:
        return reasons
    usual = float(np.median(list(explained.values())))
    for k, share in explained.items():
        if 1 - share < _WORSE * (1 - usual):
            continue
        judged = judge_order(robot, long[k], guessed=guessed[k])
        if judged.better is not None:
            reasons[logs[k].path] = (
                f"unlike the other logs, its angles and {samples[k][0]} do not fit: {judged.text(robot)}"
            )
    return reasons


def judge_table(recordings: list[Recording], robot: RobotDescription, *, by_power: bool = True) -> list[str]:
    """Checks of recordings that were merged elsewhere: by their torques or currents, then by their power.

    Lines on torques of another robot, and on axes whose order is not confirmed. Raises UserError as `check_columns`,
    `judge_logs` and `judge_recordings`.
    """
    some = recordings[:: -(-len(recordings) // _LOGS_CHECKED)]
    samples = {each.name: sample for each in some if (sample := _sample_of_recording(each, robot)) is not None}
    by_torque = _judged(robot, list(samples.values()), f"in {len(recordings)} recordings")
    for name, sample in samples.items():
        contradiction = _contradiction(sample, robot)
        if contradiction:
            raise UserError(f"recording {name}: {contradiction}")
    long = [piece for _, q, seen in samples.values() for piece in pieces(q, seen, np.ones(len(q), bool), _STEP_S)]
    doubts = [line] if long and (line := other_robot(robot, long)) else []
    return doubts + (judge_recordings(recordings, robot, by_torque) if by_power else [])


def judge_recordings(
    recordings: list[Recording], robot: RobotDescription, by_torque: OrderJudgement | None
) -> list[str]:
    """Lines on axes whose order neither the torques nor the power of recordings confirm.

    Raises UserError when the power fits the robot clearly better in another order of the axes, or in the reverse order
    of the rows. `by_torque`: what torques say.
    """
    if reverse := reversed_rows(robot, recordings):
        raise UserError(reverse)
    if by_torque is not None and not by_torque.unsure:
        return []
    some = recordings[:: -(-len(recordings) // _LOGS_CHECKED)]
    long = [piece for recording in some for piece in _power_pieces(recording, robot.axes)]
    zero = judge_zeros(robot, long) if long else None  # power has other causes, too: no reason to refuse
    doubts = [f"angles and power hardly fit as logged: {zero.text(robot)}"] if zero is not None else []
    judged = judge_order(robot, long)
    if judged.better is not None and (by_torque is None or judged.better in by_torque.unsure):
        by_zero = zero is not None and zero.share > share_of(robot, long, judged.better)
        text = zero.text(robot) if zero is not None and by_zero else judged.text(robot)
        raise UserError(f"angles and power of {len(recordings)} recordings do not fit as logged: {text}")
    judged = judged if by_torque is None else by_torque.together(judged)
    if long and judged.unsure and _unrelated(share := share_of(robot, long), robot, long):
        return [*doubts, _unexplained(share)]
    witness = "by their power" if by_torque is None else "by their torques, currents and power"
    return doubts + ([note] if (note := judged.note(robot, witness)) else [])


def _unrelated(share: float, robot: RobotDescription, samples: list[OrderSample]) -> bool:
    """Whether the motion explains little of the power, although it lifts masses that need much.

    An arm that stands, and a joint with a vertical axis, show little in any power.
    """
    return share < MIN_R2 <= share_of_weight(robot, samples)


def _unexplained(share: float) -> str:
    return (
        f"the motion explains {percent(max(share, 0.0))} of the changes of the power, but lifts the arm's masses: "
        "is it the power of this robot, in these rows, and do the columns of angles hold angles? The order of the "
        "axes cannot be judged either"
    )


def _power_pieces(recording: Recording, axes: int) -> Iterator[OrderSample]:
    step_s = float(np.median(np.diff(recording.time_ns))) * 1e-9
    return pieces(recording.of_axes("q", axes), recording.columns["P"], recording.valid, step_s)


def _judged(robot: RobotDescription, samples: list[Sample], where: str) -> OrderJudgement | None:
    """What torques or currents say of the order; None without samples. Raises UserError for another order."""
    if not samples:
        return None
    guessed = samples[0][0] == "currents" and any(joint.guesses_drive for joint in robot.joint)
    long = [piece for _, q, seen in samples for piece in pieces(q, seen, np.ones(len(q), bool), _STEP_S)]
    _require_scale(robot, samples, where)
    judged = judge_order(robot, long, guessed=guessed)
    zero = judge_zeros(robot, long, guessed=guessed) if long else None
    if zero is not None and (
        judged.better is None or zero.share > share_of(robot, long, judged.better, guessed=guessed)
    ):
        raise UserError(f"{where}, angles and {samples[0][0]} do not fit as logged: {zero.text(robot)}")
    if judged.better is not None:
        raise UserError(f"{where}, angles and {samples[0][0]} do not fit as logged: {judged.text(robot)}")
    return judged


def _require_scale(robot: RobotDescription, samples: list[Sample], where: str) -> None:
    """Raises UserError for torques of another unit, of the motors' side, or that are only noise.

    Gravity gives the scale: joints that carry the arm, by more than their friction. Friction alone moves a joint with
    a vertical axis. Currents have guessed gains, and no scale.
    """
    if samples[0][0] != "torques":
        return
    computed, logged, weight = [], [], []
    for _, q, seen in samples:
        qd = np.gradient(q, _STEP_S, axis=0)
        some = slice(None, None, _THINNED)
        computed.append(inverse_dynamics(robot, q[some], qd[some], np.gradient(qd, _STEP_S, axis=0)[some]))
        logged.append(seen[some])
        weight.append(inverse_dynamics(robot, q[some], 0 * qd[some], 0 * qd[some]))
    needed, there, carried = (np.concatenate(each).std(axis=0) for each in (computed, logged, weight))
    friction = np.array([joint.friction.coulomb if joint.friction else 0.0 for joint in robot.joint])
    loaded = np.flatnonzero((needed > _MIN_DEVIATION_NM) & (carried > np.maximum(_MIN_DEVIATION_NM, friction)))
    if not len(loaded):
        return
    ratios = there[loaded] / needed[loaded]
    worst = int(np.argmax(np.abs(np.log(np.maximum(ratios, 1e-9)))))
    usual = float(np.median(ratios))
    if 1 / _OTHER_UNIT < usual < _OTHER_UNIT and 1 / _OTHER_UNIT < ratios[int(needed[loaded].argmax())] < _OTHER_UNIT:
        return
    name = robot.joint[int(loaded[worst])].name
    raise UserError(
        f"{where}, the torque of {name} varies {ratios[worst]:.3g} times as much as the described masses need: is it "
        "in mNm or per cent, at the motor before the gear, or noise of a joint that is not measured? Expected Nm (N) "
        "at the joint; leave the columns out if they are not torques"
    )


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
    sample = _sample(log, robot)
    contradiction = _contradiction(sample, robot) if sample is not None else ""
    if contradiction:
        raise InputError(log.path, contradiction)


def _contradiction(sample: Sample, robot: RobotDescription) -> str:
    """How torques contradict the angles; empty if they do not.

    Torques behind the gears follow the described masses; those of the motors have friction and rotors in them, which
    may be all that a log of one moving joint shows. Currents have guessed gains: all logs together judge them.
    """
    name, q, logged = sample
    long = list(pieces(q, logged, np.ones(len(q), bool), _STEP_S))
    if name != "torques" or not long:
        return ""
    qd = np.gradient(q, _STEP_S, axis=0)
    needed = inverse_dynamics(robot, q, qd, np.gradient(qd, _STEP_S, axis=0))
    moving = np.flatnonzero((logged.std(axis=0) > _MIN_DEVIATION_NM) & (needed.std(axis=0) > _MIN_DEVIATION_NM))
    if len(moving) < 2:
        return ""
    explained = dict(zip(moving.tolist(), shares_of(robot, long)[moving].tolist(), strict=True))
    if np.median(list(explained.values())) >= _LEAST_EXPLAINED:
        return ""
    worst = min(explained, key=lambda axis: explained[axis])
    return (
        f"the torques do not belong to the angles (worst joint {robot.joint[worst].name}, of which masses, "
        f"friction and rotor explain {percent(max(explained[worst], 0.0))}): are the columns in the order of "
        f"{robot.name}'s axes, and of this recording?"
    )


def _sample(log: RobotLog, robot: RobotDescription) -> Sample | None:
    """The name of what stands for torques, angles and torques [T, axes] at even times; None without torques."""
    named = _torques(robot, log.tau if best_torque(log) == "measured" else None, log.current)
    if named is None:
        return None
    time, rows = in_time(log)
    return _sampled(named[0], time, log.q[rows], named[1][rows])


def _sample_of_recording(recording: Recording, robot: RobotDescription) -> Sample | None:
    """The same of the valid rows of a recording; None where torques and currents are missing in some of them."""
    valid = recording.valid
    if not valid.any():
        return None
    tau, current = (
        recording.of_axes(quantity, robot.axes)[valid]
        if all(f"{quantity}{axis + 1}" in recording.columns for axis in range(robot.axes))
        else None
        for quantity in ("tau", "current")
    )
    usable = tau is not None and np.isfinite(tau).all() and tau.any()
    named = _torques(robot, tau if usable else None, current)
    time = (recording.time_ns[valid] - recording.time_ns[0]) * 1e-9
    return None if named is None else _sampled(named[0], time, recording.of_axes("q", robot.axes)[valid], named[1])


def _sampled(name: str, time: Floats, q: Floats, seen: Floats) -> Sample:
    grid = np.arange(time[0], time[-1], _STEP_S)
    return name, _on_grid(grid, time, q), _on_grid(grid, time, seen)


def _torques(robot: RobotDescription, tau: Floats | None, current: Floats | None) -> tuple[str, Floats] | None:
    """[T, axes] Nm at the joints: logged, or the nominal torque of the logged currents; None without either."""
    if tau is not None:
        return "torques", tau
    if current is None or not np.isfinite(current).all():
        return None
    return "currents", current * np.array([joint.drive.effort_per_ampere for joint in robot.joint])


def _on_grid(grid: Floats, time: Floats, values: Floats) -> Floats:
    return np.column_stack([np.interp(grid, time, column) for column in values.T])
