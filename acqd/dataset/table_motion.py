"""The checks of the command line for rows that were merged elsewhere: limits, jumps, doubtful rows, power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.dataset.log_power import require_drawn, small_power
from acqd.dataset.power import PowerStream
from acqd.dataset.power_values import large_power
from acqd.errors import UserError
from acqd.robot.columns import TITLES, at_zero, judged
from acqd.robot.description import RobotDescription
from acqd.robot.doubtful_rows import bridged, doubtful_rows
from acqd.robot.garbled import FEW, beyond_limit, impossible_jump, limits, reach
from acqd.robot.joint_refresh import between_refreshes, frozen
from acqd.robot.missing_rows import missing_rows
from acqd.robot.motion_quality import MotionQuality
from acqd.robot.resolution import smoothed, smoothing_of, steps_of
from acqd.robot.unwrapping import unwrapped

_LONGEST_S = 0.25
"""Angles are not interpolated between known rows that are farther apart."""


def trusted_motion(time: Floats, q: Floats, robot: RobotDescription) -> tuple[Floats, NDArray[np.bool_], MotionQuality]:
    """Angles [T, axes], bridged where doubtful, smoothed where coarse; which rows [T] are known; what was found.

    `time` [T] s is even. Raises ValueError that says what no motion of this robot can be.
    """
    finite = np.asarray(np.isfinite(q).all(axis=1))
    if finite.sum() < 2:
        return q, finite, MotionQuality()
    stale = np.zeros(q.shape, bool)
    stale[finite] = frozen(time[finite], q[finite], steps_of(q[finite]), robot.acceleration)
    usable = finite & ~stale.any(axis=1)
    known = np.flatnonzero(usable)
    stamps = time[known]
    farthest = reach(np.diff(stamps), robot)
    angles = unwrapped(q[known], farthest, np.array([not joint.slides for joint in robot.joint]))
    beyond = np.abs(angles) > limits(robot)
    if beyond.any(axis=1).mean() > FEW:
        axis = int(beyond.any(axis=0).argmax())
        raise ValueError(beyond_limit(robot, axis, float(np.abs(angles[:, axis]).max())) + "; are these degrees?")
    jump = impossible_jump(stamps, angles, robot)
    if jump is not None:
        raise ValueError(f"row {int(known[jump[0] + 1]) + 1}: {jump[1]}; are rows of several recordings mixed?")
    q_step = steps_of(angles)
    lines, q_step = between_refreshes(stamps, angles, q_step, robot.speed)
    doubts = doubtful_rows(stamps, lines, robot.speed, q_step)
    names = [
        tuple(robot.joint[axis].name for axis in np.flatnonzero(flags.any(axis=0)))
        for flags in (angles != q[known], stale, lines != angles)
    ]
    mended, unknown = bridged(stamps, lines, doubts.any, _LONGEST_S)
    smoothing = smoothing_of(stamps, mended, q_step, robot.speed)
    mended = mended if smoothing is None else smoothed(stamps, mended, smoothing.windows_s)
    gap = missing_rows(stamps, mended, q_step, robot)
    if gap is not None:
        raise ValueError(f"row {int(known[gap[0]]) + 1}: {gap[1]}; are rows of several recordings mixed?")
    filled = q.copy()
    filled[known] = mended
    usable[known[unknown]] = False
    quality = replace(doubts.quality(), unwrapped=names[0], frozen=names[1], by_itself=names[2], smoothing=smoothing)
    return filled, usable, replace(quality, frozen_rows=int(stale.any(axis=1).sum()))


def without_unusable(
    columns: dict[str, NDArray[np.float64]],
    time_ns: NDArray[np.int64],
    q: NDArray[np.float64],
    known: NDArray[np.bool_],
    robot: RobotDescription,
    quality: MotionQuality,
) -> MotionQuality:
    """Removes columns that were not measured, or contradict the angles, as reading a log does; what was found."""
    names = {name: [f"{name}{axis + 1}" for axis in range(robot.axes)] for name in TITLES}
    there = {name: [column for column in of_axes if column in columns] for name, of_axes in names.items()}
    parts = {name: robot.axes - len(of_axes) for name, of_axes in there.items() if 0 < len(of_axes) < robot.axes}
    values = {
        name: np.column_stack([columns[column] for column in of_axes])[known]
        for name, of_axes in there.items()
        if len(of_axes) == robot.axes
    }
    judgement = judged(time_ns[known].astype(np.float64) * 1e-9, q[known], values, robot)
    for name in [*parts, *judgement.gone]:
        for column in there[name]:
            del columns[column]
    missing = [f"the {TITLES[name]} of {count} of {robot.axes} joints is missing" for name, count in parts.items()]
    return replace(
        quality,
        zero=at_zero(q[known], robot),
        unmeasured=tuple(judgement.unmeasured.values()),
        unusable=(*missing, *judgement.unusable.values()),
    )


def require_power(P: Floats, valid: NDArray[np.bool_], step_ns: float, robot: RobotDescription) -> None:
    """Raises UserError for power [T] W that flows out of the robot, is too small or too large for it, or constant."""
    known = P[valid & np.isfinite(P)]
    if np.ptp(known) == 0.0:
        raise UserError(f"table: P is {known[0]:g} W in all rows; is this the robot's power?")
    if large := large_power(known, robot):
        raise UserError(f"table: {large}")
    stream = PowerStream(
        np.arange(len(known)) * round(step_ns), known, np.full(len(known), np.nan), round(step_ns), 0, "mains", "table"
    )
    require_drawn(stream)
    for note in small_power([stream]):
        raise UserError(f"table: {note}")
