"""Does a logged tool point move as this robot's kinematics say? If not, the log is another robot's.

Robots of one maker have the same axes and columns, and differ in their lengths only: angles alone cannot tell a UR3e
from a UR10e. Many controllers also log where the tool's centre point (TCP) is.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.newton_euler import Chain, frames

_MOST_M = 0.015
"""Robots are calibrated within some millimetres of their drawings."""
_POSTURES = 80


def check_tool_point(path: Path, robot: RobotDescription, q: Floats, point: Floats) -> None:
    """Raises InputError for a log at `path` whose tool points [T, 3] m are not the robot's."""
    error_m = tool_point_error(robot, q, point)
    if error_m > _MOST_M:
        raise InputError(
            path,
            f"its tool point is {1000 * error_m:.0f} mm (RMS) from where the angles put it on {robot.name}, "
            f"expected {1000 * _MOST_M:.0f} mm at most: is it another robot's log, or are its points not in m?",
        )


def tool_point_error(robot: RobotDescription, q: Floats, point: Floats) -> float:
    """RMS distance [m] between logged tool points [T, 3] and those of the robot's kinematics at angles q [T, axes].

    The tool and the frame of the base are unknown: the smallest distance that any fixed point on the last link and any
    fixed frame reach. For a given point, the frame is the solution of Kabsch (1976).
    """
    finite = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(point).all(axis=1))
    rows = finite[np.linspace(0, len(finite) - 1, min(_POSTURES, len(finite))).astype(int)] if len(finite) else finite
    if len(rows) < 2:
        return 0.0
    where = frames(Chain.of(robot), q[rows])
    origin, turn = where.origin[:, -1], where.rotation[:, -1]
    target = point[rows] - point[rows].mean(axis=0)

    def distances(tool: Floats) -> Floats:
        reached = origin + turn @ tool
        reached = reached - reached.mean(axis=0)
        frame, _ = Rotation.align_vectors(target, reached)
        return np.asarray((target - frame.apply(reached)).ravel())

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # several frames fit points on a line equally well
        best = least_squares(distances, np.zeros(3))
    return float(np.sqrt(2 * best.cost / len(rows)))
