"""The checks of the command line for rows that were merged elsewhere: limits, jumps, doubtful rows, power."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.dataset.log_power import require_drawn, small_power
from acqd.dataset.power import PowerStream
from acqd.dataset.power_values import large_power
from acqd.errors import UserError
from acqd.robot.description import RobotDescription
from acqd.robot.garbled import FEW, beyond_limit, impossible_jump, limits, reach
from acqd.robot.motion import MotionQuality, bridged, doubtful_rows, unwrapped
from acqd.robot.resolution import resolution, smoothed, smoothing_of

_LONGEST_S = 0.25
"""Angles are not interpolated between known rows that are farther apart."""


def trusted_motion(time: Floats, q: Floats, robot: RobotDescription) -> tuple[Floats, NDArray[np.bool_], MotionQuality]:
    """Angles [T, axes], bridged where doubtful, smoothed where coarse; which rows [T] are known; what was found.

    `time` [T] s is even. Raises ValueError that says what no motion of this robot can be.
    """
    finite = np.asarray(np.isfinite(q).all(axis=1))
    known = np.flatnonzero(finite)
    if len(known) < 2:
        return q, finite, MotionQuality()
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
    q_step = np.array([resolution(angle) for angle in angles.T])
    doubts = doubtful_rows(stamps, angles, robot.speed, q_step)
    names = [robot.joint[axis].name for axis in np.flatnonzero((angles != q[known]).any(axis=0))]
    mended, unknown = bridged(stamps, angles, doubts.any, _LONGEST_S)
    smoothing = smoothing_of(stamps, mended, q_step, robot.speed)
    mended = mended if smoothing is None else smoothed(stamps, mended, smoothing.windows_s)
    filled, usable = q.copy(), finite.copy()
    filled[known] = mended
    usable[known[unknown]] = False
    return filled, usable, doubts.quality(unwrapped=tuple(names), smoothing=smoothing)


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
