"""Checks of a log before any alignment: rows that are too far apart, currents that are not in ampere."""

from __future__ import annotations

import numpy as np

from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.garbled import reach
from acqd.robot.log import RobotLog, in_time

SLOWEST_S = 0.125
"""Longest usual step between rows: angles are not interpolated over more than twice that (merge.py)."""
_FASTEST_S = 2e-5
"""Shortest credible step: no controller is faster than 50 kHz."""
_MANY_ROWS = 1000
"""Rows across which the way and the time are compared: packets and single wrong rows do not matter."""
_FEW_ROWS = 100
"""Rows that may have come in one packet: less are not compared."""
_SPARSE = 100.0
"""Times the usual step that rows may be apart on average: a recorder that pauses leaves gaps, not seldom rows."""
_MOVING = 0.05
"""rad/s or m/s of a joint that moves."""
_BRAKED_SHARE, _BRAKED_S = 0.1, 1.0
"""Of the motion, and so long, a joint may seem to move behind closed brakes."""
_TOO_MUCH = 10.0  # times the current that holds the joint's greatest torque
_OPEN = 0.5
_MOST_ROWS = 99  # percentile: a few rows of noise are no wrong unit


def check_log(log: RobotLog, robot: RobotDescription) -> None:
    """Raises InputError for a log that no lag would make usable."""
    time, _ = in_time(log)
    if len(time) < 2:
        raise InputError(log.path, f"has {len(time)} rows of different times; expected a recording of seconds")
    step_s = float(np.median(np.diff(time)))
    if step_s < _FASTEST_S:
        raise InputError(
            log.path, f"most of its rows are {step_s:.3g} s apart: is its time in days, or in another unit? Write s"
        )
    if step_s > SLOWEST_S:
        raise InputError(
            log.path,
            f"has a row every {step_s:.3g} s, expected one every {SLOWEST_S} s or faster: "
            + (
                "does its time count rows? Say row_s in [[log]] of the robot's description, the s between rows"
                if step_s == 1.0 and (np.diff(time) == 1.0).all()
                else "is its time in ms or us? Write s"
                if 1.0 <= step_s <= 1e6 * SLOWEST_S
                else "the motion between the rows is unknown; record at 25 Hz or more"
            ),
        )
    _check_unit(log, robot)
    span_s = float(time[-1] - time[0])
    if span_s > _SPARSE * step_s * len(time):
        raise InputError(
            log.path,
            f"has {len(time)} rows in {span_s / 3600:.3g} h, most of them {step_s:.3g} s apart; expected rows of one "
            "recording: is its time in ms, or are parts of it missing?",
        )
    check_signals(log, robot)


def check_signals(log: RobotLog, robot: RobotDescription) -> None:
    """Raises InputError for currents in another unit than ampere, and for motion behind closed brakes."""
    _check_currents(log, robot)
    _check_brake(log)


def _check_unit(log: RobotLog, robot: RobotDescription) -> None:
    """Raises InputError where a joint covers a way of many rows faster than it can."""
    time, rows = in_time(log)
    apart = min(_MANY_ROWS, len(time) // 3)
    if apart < _FEW_ROWS:
        return
    moved = np.abs(log.q[rows][apart:] - log.q[rows][: len(time) - apart])
    farthest = reach(time[apart:] - time[: len(time) - apart], robot)
    if (moved <= farthest).all():
        return
    row, axis = np.unravel_index(int(np.argmax(moved / farthest)), moved.shape)
    speed = moved[row, axis] / (time[row + apart] - time[row])
    raise InputError(
        log.path,
        f"{robot.joint[int(axis)].name} moves {speed / robot.speed[axis]:.0f} times as fast as its limit over {apart} "
        "rows: is its time in minutes, or in another unit than s? Write s",
    )


def _check_brake(log: RobotLog) -> None:
    brake = log.signals.get("brake")
    if brake is None:
        return
    time, rows = in_time(log)
    steps = np.diff(time)
    moving = (np.abs(np.diff(log.q[rows], axis=0)) > _MOVING * steps[:, None]).any(axis=1)
    closed = moving & (brake[rows][1:] < _OPEN) & (brake[rows][:-1] < _OPEN)
    braked_s, moving_s = float(steps[closed].sum()), float(steps[moving].sum())
    if braked_s > max(_BRAKED_S, _BRAKED_SHARE * moving_s):
        raise InputError(
            log.path,
            f"moves for {moving_s:.1f} s, {braked_s:.1f} s of them with closed brakes; expected brake 1 where the "
            "brakes are open: is the column inverted, or another one?",
        )


def _check_currents(log: RobotLog, robot: RobotDescription) -> None:
    if log.current is None or not np.isfinite(log.current).all(axis=1).any():
        return
    known = log.current[np.isfinite(log.current).all(axis=1)]
    usual = np.percentile(np.abs(known), _MOST_ROWS, axis=0)
    drives = [(joint.effort, joint.drive.effort_per_ampere) for joint in robot.joint]
    greatest = np.array([torque / per_ampere for torque, per_ampere in drives])
    axis = int(np.argmax(usual / greatest))
    if usual[axis] > _TOO_MUCH * greatest[axis]:
        raise InputError(
            log.path,
            f"{robot.joint[axis].name} draws a current of {usual[axis]:.4g}, but {greatest[axis]:.3g} A are its "
            "greatest torque: are the currents in mA? Write A",
        )
