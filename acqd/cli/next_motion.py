"""`acqd next`: the motion that decides between the causes which a report leaves open."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.atomic import require_free
from acqd.cli.folded_table import Table
from acqd.cli.options import Corners, Json, box_of
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.extras import LOOP, MOTION, require
from acqd.report.joint_names import all_with_joint_names, with_joint_names


def next_motion(
    report: Annotated[Path, typer.Argument(metavar="REPORT", help="Folder of a report, from acqd close-loop.")],
    minutes: Annotated[float, typer.Option(min=0.5, max=30, help="Longest duration of the program.")] = 3.0,
    cause: Annotated[
        list[str] | None,
        typer.Option(help="Compare this effect; may be repeated (default: what the report leaves open)."),
    ] = None,
    workspace: Annotated[
        Corners | None,
        typer.Option(metavar="X Y Z X Y Z", help="Two corners of a box that the flange stays in, m."),
    ] = None,
    scene: Annotated[str, typer.Option(help="Obstacles: a shipped scene, or a TOML file with boxes.")] = "free",
    limit_speed: Annotated[
        float, typer.Option(min=1, max=100, help="Percent of the robot's speed limits; never above measured speeds.")
    ] = 50.0,
    seed: Annotated[int, typer.Option(min=0, help="Of the random pieces of motion.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder for program and report (default REPORT.next).")] = None,
    json: Json = False,
) -> None:
    """Design the recording that decides: a program of a few minutes, its picture, and what to expect after it.

    The program keeps the limits of the robot, measured ranges and speeds, and free of collisions with itself and the
    boxes of the scene. A person has to check the program before anything moves.

    Example: acqd next ds.loop --minutes 3 --limit-speed 50
    """
    require("acqd next", (*LOOP, *MOTION), "loop,motion")
    from acqd.dataset.places import default_folder
    from acqd.experiment.design import Asked, as_json, next_motion
    from acqd.experiment.page import headline, steps, table
    from acqd.experiment.written import write_all

    box = box_of(workspace)
    folder = out or default_folder(report, "next")
    require_free(folder, "next.json", "design")
    console = terminal(stderr=True)
    with progress(console) as show_step:
        designed = next_motion(
            report, Asked(minutes, box, scene, limit_speed / 100, tuple(cause or ()), seed), show_step
        )
        show_step("drawing", 0.95)
        write_all(folder, designed)
    if json:
        print(orjson.dumps(as_json(designed) | {"out": str(folder)}).decode())
        return
    screen, joints = terminal(tables=True), designed.question.subject.robot.joint_names
    screen.print(with_joint_names(headline(designed), joints))
    if not designed.answered:
        header, rows = all_with_joint_names(table(designed), joints)
        shown = Table(*header)
        for row in rows:
            shown.add_row(*row)
        screen.print(shown)
    for step in steps(designed):
        screen.print(f"next: {with_joint_names(step, joints)}")
    screen.print(f"program and report: {folder}")
