"""`acqd save`: motion that would have used less, with what the model is sure of."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.atomic import require_free
from acqd.cli.folded_table import Table
from acqd.cli.options import Corners, Json, box_of
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import LOOP, MOTION, require

if TYPE_CHECKING:
    from acqd.saving.proposals import Savings


def save(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Bundle of a grey box or hybrid.")],
    work: Annotated[Path, typer.Argument(metavar="LOG|PROGRAM", help="Robot log, or program file (.toml).")],
    robot: Annotated[str | None, typer.Option(help="Description of the robot (default: the model's).")] = None,
    longer: Annotated[
        str, typer.Option(help="Longer cycle time that is allowed: percent (10%) or the cycle time itself (65s).")
    ] = "10%",
    workspace: Annotated[
        Corners | None,
        typer.Option(metavar="X Y Z X Y Z", help="Two corners of a box that the flange stays in, m."),
    ] = None,
    scene: Annotated[str, typer.Option(help="Obstacles: a shipped scene, or a TOML file with boxes.")] = "free",
    limit_speed: Annotated[
        float, typer.Option(min=1, max=100, help="Percent of the robot's speed limits; never above known speeds.")
    ] = 100.0,
    brakes_after: Annotated[
        float, typer.Option(min=0.1, max=600, help="s of standstill until brakes may close.")
    ] = 2.0,
    least_rest: Annotated[float, typer.Option(min=0, max=600, help="s that stay of every pause.")] = 0.5,
    keep_waits: Annotated[bool, typer.Option("--keep-waits", help="Pauses keep their durations.")] = False,
    free_order: Annotated[
        bool, typer.Option("--free-order", help="The points of a program may be visited in any order.")
    ] = False,
    payload: Annotated[
        float | None,
        typer.Option(min=-20, max=20, help="kg: also say what so much more at the flange would use."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for programs and report (default LOG.save).")] = None,
    json: Json = False,
) -> None:
    """What another timing, fewer waits or closed brakes would have used for the same work, and a program that does so.

    The path does not change. A person has to check the program before anything moves.

    Example: acqd save ds.models/grey-box-everything-s1 logs/pick.csv --longer 10%
    """
    require("acqd save", (*LOOP, *MOTION), "loop,motion")
    from acqd.dataset.places import default_folder
    from acqd.report.chain import REPORT, connect
    from acqd.saving.proposals import savings
    from acqd.saving.source import Asked, opened
    from acqd.saving.tables import as_json
    from acqd.saving.written import write_all

    share, seconds = _longer(longer)
    box, speed = box_of(workspace), limit_speed / 100
    asked = Asked(share, seconds, scene, box, speed, brakes_after, least_rest, keep_waits, payload, free_order, robot)
    folder = out or default_folder(work, "save")
    require_free(folder, "save.json", "proposal")
    with progress(terminal(stderr=True)) as show_step:
        show_step("opening", 0.0)
        found = savings(opened(model, work, asked), asked, show_step)
        show_step("drawing", 0.95)
        write_all(folder, found)
    connect(folder / "save.html", [model.parent / REPORT])
    if json:
        print(orjson.dumps(as_json(found) | {"out": str(folder)}).decode())
        return
    _print(found, folder)


def _longer(text: str) -> tuple[float, float | None]:
    """Share by which the cycle may last longer, or a cycle time in s."""
    found = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*([%s])\s*", text)
    value, unit = (float(found[1]), found[2]) if found else (0.0, "")
    if unit == "%" and value <= 200:
        return value / 100, None
    if unit == "s" and value > 0:
        return 0.0, value
    raise UserError(f"--longer {text}: expected percent up to 200, such as 10%, or a cycle time, such as 65s")


def _print(found: Savings, folder: Path) -> None:
    from acqd.saving.page import steps
    from acqd.saving.tables import HEADER, headline, table, what_if_text

    screen = terminal(tables=True)
    screen.print(headline(found))
    shown = Table(*HEADER)
    for column in shown.columns[1:]:
        column.justify = "right"
    for block in (found.equal, found.other):
        for row in table(block):
            shown.add_row(*row)
        shown.add_section()
    screen.print(shown)
    for what_if in found.what_ifs:
        screen.print(what_if_text(what_if))
    for each in found.refused:
        screen.print(f"not proposed: {each.name}: {each.reason}")
    for text in found.unknown:
        screen.print(f"the model cannot tell: {text}")
    for step in steps(found):
        screen.print(f"next: {step}")
    screen.print(f"programs and report: {folder}")
