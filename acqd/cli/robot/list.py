"""`acqd robot list`: the shipped robot descriptions."""

from __future__ import annotations

from typing import Any

import orjson

from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.report.digits import percent
from acqd.robot.description import RobotDescription, load_description, shipped_descriptions


def show_list(json: Json = False) -> None:
    """List the shipped robots: axes, masses, what is known of the drives, and which values are guessed.

    With --json also the sources of each description and the kinds of logs whose columns are known.

    Example: acqd robot list
    """
    rows = [_row(load_description(name)) for name in shipped_descriptions()]
    if json:
        print(orjson.dumps(rows).decode())
        return
    table = Table("name", "robot", "axes", "moving kg", "masses within", "drives", "guessed")
    for row in rows:
        mass, within = f"{row['moving_mass_kg']:.1f}", percent(row["mass_deviation"])
        guessed = ", ".join(row["guessed"])
        table.add_row(row["name"], row["title"], str(row["axes"]), mass, within, row["drives"], guessed)
    terminal(soft_wrap=False, tables=True).print(table)


def _row(robot: RobotDescription) -> dict[str, Any]:
    guessed = sorted({key for joint in robot.joint for key in joint.guessed})
    return {
        "name": robot.name,
        "title": robot.title,
        "axes": robot.axes,
        "moving_mass_kg": round(sum(joint.link.mass for joint in robot.joint), 3),
        "mass_deviation": robot.mass_deviation,
        "drives": _drives(robot),
        "guessed": guessed,
        "logs": [layout.format for layout in robot.log],
        "sources": robot.sources,
    }


def _drives(robot: RobotDescription) -> str:
    """Whether the gain from current to torque is known, joint by joint."""
    count = sum(joint.guesses_drive for joint in robot.joint)
    if count in (0, robot.axes):
        return "guessed" if count else "gains known"
    return f"{count} of {robot.axes} guessed"
