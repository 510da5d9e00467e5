"""Whether the other columns of a log fit its angles: quantities that stay constant, speeds, temperatures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription

_MANY_ROWS = 200
"""Rows over which no measured torque or current of a moving joint has one value only."""
_SLOWEST = 0.05
"""rad/s or m/s of a joint whose slope tells its speed."""
_FEWEST = 100
_DEGREES = 0.02
"""Difference of the ratio of speeds to slopes from that of radians to degrees, over it, by which angles are known."""
_SPEED = (0.7, 1.4)
"""Speed over the slope of the angle: filters of the controller and the rows between change it by less."""
_KELVIN = 200.0
"""degC that no joint reaches."""


def stuck(name: str, values: Floats, moves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """[axes] whether the column of a joint that moves, of columns [T, axes], holds zeros only, or one number too often.

    A temperature may be constant, and a joint may be at 0 degC, but not all joints.
    """
    if name == "temperature":
        return np.full(len(moves), bool((values == 0.0).all() or (values == -1.0).all()))
    often = len(values) >= _MANY_ROWS
    return np.asarray(moves & (np.ptp(values, axis=0) == 0.0) & (often | (values[0] == 0.0)))


def speed_fault(time: Floats, q: Floats, qd: Floats, robot: RobotDescription) -> str:
    """Why speeds [T, axes] are not those of the angles at rising times [T] s; empty if they are, or nothing moves."""
    for axis, ratio in _speed_ratios(time, q, qd).items():
        if not _SPEED[0] < ratio < _SPEED[1]:
            unit = ", in deg/s?" if 40 < ratio < 80 else ", of another sign?" if -1.4 < ratio < -0.7 else ""
            return f"the speed of {robot.joint[axis].name} is {ratio:.3g} times the slope of its angle{unit}"
    return ""


def angle_fault(time: Floats, q: Floats, qd: Floats, robot: RobotDescription) -> str:
    """Why angles are in degrees, by speeds in rad/s that fit them; empty otherwise. Arguments as of `speed_fault`."""
    turning = [r for axis, r in _speed_ratios(time, q, qd).items() if not robot.joint[axis].slides]
    if not turning or any(abs(np.degrees(ratio) - 1) > _DEGREES for ratio in turning):
        return ""
    return "its speeds are pi/180 times the slopes of its angles: the angles are in degrees; write radians"


def _speed_ratios(time: Floats, q: Floats, qd: Floats) -> dict[int, float]:
    """Speed over slope of the angle, of the axes that move."""
    if len(time) < _FEWEST:
        return {}
    slope = (q[2:] - q[:-2]) / (time[2:] - time[:-2])[:, None]
    ratios = {}
    for axis in range(q.shape[1]):
        seen = qd[1:-1, axis]
        moves = (np.abs(slope[:, axis]) > _SLOWEST) & np.isfinite(seen)
        if moves.sum() >= _FEWEST:
            ratios[axis] = float(np.median(seen[moves] / slope[moves, axis]))
    return ratios


def temperature_fault(values: Floats) -> str:
    """Why temperatures [T, axes] are not in degC; empty if they may be."""
    known = values[np.isfinite(values)]
    if len(known) and np.median(known) > _KELVIN:
        return f"temperatures of {np.median(known):.0f} are not degC: in K?"
    return ""
