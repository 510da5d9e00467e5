"""Pictures of an arm."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription
from acqd.robot.posture import Posture

_ARM, _MASS, _CAPSULE = "#d97706", "#2563eb", "#94a3b8"
_AXIS_M = 0.08
_POINTS = 190  # points of the figure from edge to edge of a drawing


def arm_picture(robot: RobotDescription) -> Figure:
    """The arm in two postures: all joints in the middle of their limits, and a quarter of the way to the upper ones."""
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    for k in robot.sliding:
        low[k], high[k] = robot.lower[k], robot.upper[k]
    middle = (low + high) / 2
    postures = {
        "all joints in the middle of their limits": middle,
        "a quarter of the way to the upper limits": middle + (high - low) / 8,
    }
    figure = Figure(figsize=(11, 5.2))
    for number, (title, q) in enumerate(postures.items()):
        axes: Any = figure.add_subplot(1, 2, number + 1, projection="3d")
        _draw(axes, robot, q)
        axes.set_title(title, fontsize=12)
    handles = [
        Line2D([], [], color=_ARM, lw=2, marker="o", ms=4), Line2D([], [], color="black", lw=1),
        Line2D([], [], color=_MASS, lw=0, marker="o", alpha=0.7), Line2D([], [], color=_CAPSULE, lw=6, alpha=0.3),
    ]  # fmt: skip
    names = ["frames of base, joints and flange", "joint axes", "centres of mass", "collision capsules"]
    figure.legend(handles, names, loc="lower center", ncols=4, frameon=False, fontsize=10)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    return figure


def _draw(axes: Any, robot: RobotDescription, q: Floats) -> None:
    posture = Posture.of(robot, q)
    origins = posture.points
    half = _half_width(origins)
    bodies = [robot.base.capsules, *(joint.capsules for joint in robot.joint)]
    for k, capsules in enumerate(bodies):
        for capsule in capsules:
            ends = np.array([posture.placed(k, end) for end in (capsule.start, capsule.end)])
            axes.plot(
                *ends.T, color=_CAPSULE, linewidth=_POINTS * capsule.radius / half, alpha=0.3, solid_capstyle="round"
            )
    axes.plot(*origins.T, color=_ARM, linewidth=2, marker="o", markersize=4)
    for k, joint in enumerate(robot.joint, start=1):
        place = posture.origin[k]
        direction = posture.rotation[k] @ (np.array(joint.axis) / np.linalg.norm(joint.axis))
        ends = np.array([place - _AXIS_M * direction, place + _AXIS_M * direction])
        axes.plot(*ends.T, color="black", linewidth=1, linestyle="--" if joint.slides else "-")
        centre = posture.placed(k, joint.link.com)
        axes.scatter(*centre, s=12 * joint.link.mass + 4, color=_MASS, alpha=0.7)
        axes.text(*(place + 1.3 * _AXIS_M * direction), str(k), fontsize=11)
    _equal(axes, origins)


def _equal(axes: Any, points: Floats) -> None:
    """The same scale along all axes, around what is drawn."""
    centre, half = (points.max(axis=0) + points.min(axis=0)) / 2, _half_width(points)
    for name, middle in zip("xyz", centre, strict=True):
        getattr(axes, f"set_{name}lim")(middle - half, middle + half)
        getattr(axes, f"set_{name}label")(f"{name} [m]", fontsize=10)
        getattr(axes, f"{name}axis").pane.set_visible(False)  # its grey would be dirt on a dark page
    axes.tick_params(labelsize=9)
    axes.set_box_aspect((1, 1, 1))


def _half_width(points: Floats) -> float:
    """Half the width of a drawing [m]."""
    return max(float(np.ptp(points, axis=0).max()), 0.2) * 0.6
