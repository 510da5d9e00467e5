"""`acqd guide`: where the work in a folder stands, and the line to type next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.markup import escape

from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.guide.found import found_in
from acqd.guide.stages import stages

_SIGNS = {"done": "[green]done [/green]", "now": "[bold yellow]now  [/bold yellow]", "later": "[dim]later[/dim]"}


def guide(
    folder: Annotated[Path, typer.Argument(metavar="[FOLDER]", help="With your datasets and reports.")] = Path(),
    html: Annotated[Path | None, typer.Option(help="Also write the stages as a page to this file.")] = None,
    json: Json = False,
) -> None:
    """Show the way from the robot to the repaired model: what is done, what to do now, and the command for it.

    The stages are robot, data, model, whether the recordings can tell, loop, answer or next motion, repaired model. The
    newest recordings that the newest model has not seen are looked at.

    Example: acqd guide
    """
    found = found_in(folder)
    steps = stages(found)
    if html is not None:
        from acqd.guide.page import write_page

        write_page(html, found, steps)
    if json:
        result = {"folder": str(folder), "stages": [step.as_json() for step in steps], "unread": found.unread}
        print(orjson.dumps(result | ({"page": str(html)} if html else {})).decode())
        return
    console = terminal()
    for step in steps:
        console.print(f"{_SIGNS[step.state]}  {step.name}: {escape(step.says)}", markup=True)
        for command in step.commands if step.state == "now" else ():
            console.print(f"         {command}", markup=False)
    for path in found.unread:
        console.print(f"{path}: has another form than acqd writes; left out", markup=False)
    if html is not None:
        console.print(f"page: {html}", markup=False)
