"""`acqd robot check`: what a description guesses, what is implausible, what matters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer
from rich.console import Console
from rich.markup import escape

from acqd.atomic import require_page
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.extras import require

if TYPE_CHECKING:
    from acqd.robot_check.check import Check

_COLOUR = {"wrong": "red", "doubtful": "yellow"}
_SHOWN = 10


def check(
    robot: Annotated[str, typer.Argument(metavar="NAME_OR_FILE", help="Shipped robot, or a description's path.")],
    out: Annotated[Path | None, typer.Option(help="HTML report with a picture of the arm.")] = None,
    json: Json = False,
) -> None:
    """Say what a description guesses and how much power hangs on it; exit 1 when a value cannot be right.

    Example: acqd robot check arm.toml --out arm.html
    """
    require("acqd robot check", ("scipy",), "loop")
    if out is not None:
        require_page(out)
        require("acqd robot check --out", ("jinja2", "matplotlib"), "loop")
    from acqd.robot.description import load_description
    from acqd.robot_check.check import check_description

    description = load_description(robot)
    with Console(stderr=True).status("computing the power of 60 s of motion"):
        checked = check_description(description)
    if out is not None:
        from acqd.robot_check.page import check_page

        check_page(checked).write(out)
    if json:
        print(orjson.dumps(checked.as_json() | {"report": None if out is None else str(out)}).decode())
    else:
        _print(checked, out)
    if checked.wrong:
        raise typer.Exit(1)


def _print(checked: Check, out: Path | None) -> None:
    console = Console(highlight=False, soft_wrap=True)
    console.width = max(console.width, 110)
    console.print(f"{checked.robot.name}: {checked.robot.title}, {checked.robot.axes} axes", markup=False)
    for each in checked.findings:
        text = escape(f"{each.where}: {each.finding}; {each.advice}")
        console.print(f"[{_COLOUR[each.state]}]{each.state}[/] {text}")
    if not checked.findings:
        console.print("nothing implausible")
    if checked.doubt:
        console.print(f"[yellow]guessed[/] {escape(checked.doubt)}")
    for name, keys in checked.guesses.items():
        console.print(f"guessed of {name}: {', '.join(keys) or 'nothing'}", markup=False)
    power = checked.power
    console.print(
        f"60 s within the limits: {power.mean_W:.0f} W on average, {power.peak_W:.0f} W at most, "
        f"standard deviation {power.deviation_W:.0f} W, without standby"
    )
    matters = Table("joint", "value", "", "times or divided by", "RMS change \\[W]")
    for one in power.influences[:_SHOWN]:
        value = f"{one.key} = {one.value:g} {one.unit}"
        matters.add_row(
            escape(one.joint), escape(value), "guessed" if one.guessed else "", f"{one.factor:g}", f"{one.change_W:.1f}"
        )
    console.print(matters)
    if out is not None:
        console.print(f"report: {out}", markup=False)
