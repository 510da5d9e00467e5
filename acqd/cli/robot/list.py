"""`acqd robot list`: the shipped robot descriptions."""

from __future__ import annotations

from typing import Any

import orjson
from rich.table import Table

from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.robot.description import load_description, shipped_descriptions


def show_list(json: Json = False) -> None:
    """List the shipped robots, their axes and how many of their values are guessed.

    Example: acqd robot list
    """
    rows: list[dict[str, Any]] = []
    for name in shipped_descriptions():
        robot = load_description(name)
        guessed = sorted({key for joint in robot.joint for key in joint.guessed})
        rows.append({"name": name, "title": robot.title, "axes": robot.axes, "guessed": guessed})
    if json:
        print(orjson.dumps(rows).decode())
        return
    table = Table("name", "robot", "axes", "guessed")
    for row in rows:
        table.add_row(row["name"], row["title"], str(row["axes"]), ", ".join(row["guessed"]))
    console = terminal(soft_wrap=False, tables=True)
    console.print(table)
