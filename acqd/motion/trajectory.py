"""Source trajectories as CSV files: one row per position, one column per axis, in degrees (thesis 5.1, 5.2)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.atomic import naming
from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.table import read_table


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A named sequence of joint positions."""

    name: str
    waypoints: Floats
    """[N, axes] rad."""


def header(robot: RobotDescription) -> list[str]:
    """Column names of a trajectory file."""
    return [f"{joint.name}_deg" for joint in robot.joint]


def write_trajectory(path: Path, trajectory: Trajectory, robot: RobotDescription) -> None:
    """Write a trajectory with a resolution of 1e-6 deg."""
    rows = [",".join(f"{value:.6f}" for value in row) for row in np.degrees(trajectory.waypoints)]
    with naming(path):
        path.write_text("\n".join([",".join(header(robot)), *rows, ""]), encoding="utf-8")


def read_trajectory(path: Path, robot: RobotDescription) -> Trajectory:
    """Read a trajectory and check it against the robot's axes and limits. Raises InputError."""
    table = read_table(path)
    axes = robot.axes
    if table.header is not None and table.header != header(robot):
        raise InputError(path, f"header {','.join(table.header)[:80]}; expected {','.join(header(robot))}")
    if table.values.shape[1] != axes:
        raise InputError(path, f"has {table.values.shape[1]} columns, but {robot.name} has {axes} axes")
    bad = np.argwhere(~np.isfinite(table.values))
    if len(bad):
        raise InputError(path, f"row {table.line(int(bad[0][0]))}: column {bad[0][1] + 1} is not a number")
    lower, upper = np.degrees(robot.lower), np.degrees(robot.upper)
    beyond = np.argwhere((table.values < lower - 1e-6) | (table.values > upper + 1e-6))
    if len(beyond):
        row, axis = (int(k) for k in beyond[0])
        raise InputError(
            path,
            f"row {table.line(row)}: {robot.joint[axis].name} = {table.values[row, axis]:g} deg is outside "
            f"{lower[axis]:g} .. {upper[axis]:g} deg of {robot.name}",
        )
    return Trajectory(path.stem, np.clip(np.radians(table.values), robot.lower, robot.upper))
