"""`acqd robot`: robot descriptions, shipped, from URDF files, and checked."""

from __future__ import annotations

import typer

from acqd.cli.robot.ability import ability
from acqd.cli.robot.calibrate import calibrate
from acqd.cli.robot.check import check
from acqd.cli.robot.from_urdf import from_urdf
from acqd.cli.robot.list import show_list

app = typer.Typer(no_args_is_help=True)
app.command("list")(show_list)
app.command("from-urdf")(from_urdf)
app.command("check")(check)
app.command("calibrate")(calibrate)
app.command("ability")(ability)


@app.callback()
def robot() -> None:
    """Describe robots: list the shipped ones, read a URDF, check a description, calibrate a model.

    `ability` shows what a motion can tell.
    """
