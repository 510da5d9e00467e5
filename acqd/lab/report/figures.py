"""Figures of workspaces, trajectories and executions (thesis Figures 5.1 to 5.4)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from acqd.arrays import Floats
from acqd.motion.excitation import Cube
from acqd.motion.trajectory import Trajectory
from acqd.robot.arm import Arm
from acqd.robot.collision import dense_path
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.newton_euler import rotation_of
from acqd.robot.posture import Posture
from acqd.robot.scene import Box, Scene

_ROBOT, _PATH, _CUBE, _BOX = "#d97706", "#2563eb", "#059669", "#64748b"
_GROUND = -0.1  # m, lower limit of what is drawn
_EDGES = [
    (a, b)
    for a, b in combinations(product((-0.5, 0.5), repeat=3), 2)
    if sum(x != y for x, y in zip(a, b, strict=True)) == 1
]


def limited_space(arm: Arm, scene: Scene, cube: Cube, trajectories: Sequence[Trajectory]) -> Figure:
    """The cube with all points, and the robot at some of them (thesis Figure 5.1)."""
    figure = Figure(figsize=(11, 5))
    axes: Any = figure.add_subplot(1, 2, 1, projection="3d")
    first = trajectories[0].waypoints
    _draw_scene(axes, scene)
    _draw_cube(axes, cube)
    for q in first[:: max(1, len(first) // 4)]:
        _draw_robot(axes, arm, q, alpha=0.5)
    positions = forward_kinematics(arm, np.concatenate([t.waypoints for t in trajectories]))[0]
    axes.scatter(*positions.T, s=1.5, color=_PATH, alpha=0.5)
    _frame(axes, f"{len(trajectories)} trajectories, {len(positions)} points")
    zoomed: Any = figure.add_subplot(1, 2, 2, projection="3d")
    path = forward_kinematics(arm, dense_path(first, np.radians(2)))[0]
    zoomed.plot(*path.T, color=_PATH, linewidth=0.8)
    zoomed.scatter(*forward_kinematics(arm, first)[0].T, s=14, facecolors="none", edgecolors="black")
    _draw_cube(zoomed, cube)
    zoomed.set(title=f"{trajectories[0].name}: points and PTP paths", xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    zoomed.set_box_aspect((1, 1, 1))
    _clear(zoomed)
    figure.tight_layout()
    return figure


def all_space(arm: Arm, scene: Scene, trajectories: Sequence[Trajectory]) -> Figure:
    """The collision boxes, the robot in random poses, and the paths of its flange (thesis Figure 5.2)."""
    figure = Figure(figsize=(11, 5))
    axes: Any = figure.add_subplot(1, 2, 1, projection="3d")
    _draw_scene(axes, scene)
    for q in [t.waypoints[1] for t in trajectories[:6]]:
        _draw_robot(axes, arm, q, alpha=0.8)
    _frame(axes, "collision boxes and random poses")
    paths: Any = figure.add_subplot(1, 2, 2, projection="3d")
    _draw_scene(paths, scene, alpha=0.05)
    for trajectory in trajectories[:12]:
        path = forward_kinematics(arm, dense_path(trajectory.waypoints, np.radians(3)))[0]
        paths.plot(*path.T, linewidth=0.6, alpha=0.7)
    points = sum(len(t.waypoints) - 1 for t in trajectories)
    _frame(paths, f"flange paths of {min(12, len(trajectories))} of {len(trajectories)} trajectories, {points} points")
    figure.tight_layout()
    return figure


def blending(arm: Arm, trajectory: Trajectory, executed: Floats) -> Figure:
    """PTP paths without blending, and the executed path with blending (thesis Figure 5.3)."""
    figure = Figure(figsize=(6, 5))
    axes: Any = figure.add_subplot(projection="3d")
    straight = forward_kinematics(arm, dense_path(trajectory.waypoints, np.radians(2)))[0]
    axes.plot(*straight.T, color=_BOX, linewidth=0.9, label="PTP without blending")
    axes.plot(*forward_kinematics(arm, executed)[0].T, color=_ROBOT, linestyle=":", linewidth=1.8, label="executed")
    axes.scatter(*forward_kinematics(arm, trajectory.waypoints)[0].T, s=16, facecolors="none", edgecolors="black")
    axes.set(title=trajectory.name, xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.legend(loc="upper left", bbox_to_anchor=(-0.15, 1.12), fontsize=10)
    axes.set_box_aspect((1, 1, 1))
    _clear(axes)
    return figure


def two_executions(names: Sequence[str], executions: Sequence[Floats], rate: float) -> Figure:
    """Joint angles of a trajectory executed twice with random blending and speed (thesis Figure 5.4)."""
    axes_count = executions[0].shape[1]
    figure = Figure(figsize=(10, 1.25 * axes_count + 0.6))
    panels: Any = figure.subplots(axes_count, 1, sharex=True, squeeze=False)[:, 0]
    for axis, panel in enumerate(panels):
        for number, (q, colour) in enumerate(zip(executions, (_PATH, _ROBOT), strict=True), start=1):
            label = f"execution {number}"
            panel.plot(np.arange(len(q)) / rate, np.degrees(q[:, axis]), color=colour, linewidth=1, label=label)
        panel.set_ylabel(f"angle {names[axis]} [°]", fontsize=8)
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=8, ncol=2, loc="upper right")
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    figure.tight_layout()
    return figure


def _draw_robot(axes: Any, arm: Arm, q: Floats, alpha: float) -> None:
    axes.plot(*Posture.of(arm.description, q).points.T, "o-", color=_ROBOT, linewidth=3, markersize=3, alpha=alpha)


def _draw_cube(axes: Any, cube: Cube) -> None:
    centre = np.array(cube.centre)
    for start, end in _EDGES:
        axes.plot(*(centre + cube.edge * np.array([start, end])).T, color=_CUBE, linewidth=1)


def _draw_scene(axes: Any, scene: Scene, alpha: float = 0.18) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    for box in scene.box:
        axes.add_collection3d(Poly3DCollection(_faces(box), facecolor=_BOX, edgecolor=_BOX, linewidth=0.4, alpha=alpha))


def _faces(box: Box) -> list[Floats]:
    turn = rotation_of(box.rpy_deg)
    faces = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for side in (-0.5, 0.5):
            corners = np.empty((4, 3))
            corners[:, axis] = side
            corners[:, others] = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            face = np.array(box.centre) + (corners * box.size) @ turn.T
            face[:, 2] = np.maximum(face[:, 2], _GROUND)  # the top of a solid table or floor is enough
            faces.append(face)
    return faces


def _frame(axes: Any, title: str) -> None:
    axes.set(
        xlim=(-0.9, 1.1), ylim=(-1, 1), zlim=(-0.2, 1.4), xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=title
    )
    axes.set_box_aspect((2, 2, 1.6))
    axes.view_init(elev=22, azim=-58)
    _clear(axes)


def _clear(axes: Any) -> None:
    """Few ticks, which would run into each other, and no panes: their grey would be dirt on a dark page."""
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
        axis.set_major_locator(MaxNLocator(5))
