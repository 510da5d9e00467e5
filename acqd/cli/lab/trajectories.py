"""`acqd lab trajectories`: random source trajectories for excitation."""

from __future__ import annotations

import shutil
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.cli.lab.options import LabFile, Robot, Scene, Seed, settings_from
from acqd.cli.options import Json
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.errors import UserError


class Space(StrEnum):
    """The algorithm that draws the trajectories."""

    LIMITED = "limited"
    ALL = "all"
    BOTH = "both"


def trajectories(
    out: Annotated[Path, typer.Option(help="Folder for the CSV files, figures and the report.")],
    space: Annotated[
        Space, typer.Option(help="Limited space (Algorithm 1), all space (Algorithm 2), or both.")
    ] = Space.BOTH,
    limited: Annotated[int, typer.Option(min=1, help="Trajectories in limited space.")] = 46,
    all_space: Annotated[int, typer.Option("--all", min=1, help="Trajectories in all space.")] = 30,
    cube: Annotated[
        tuple[float, float, float, float] | None, typer.Option(metavar="X Y Z EDGE", help="Cube of limited space in m.")
    ] = None,
    thesis: Annotated[bool, typer.Option("--thesis", help="Check paths at only 10 points, as in the thesis.")] = False,
    robot: Robot = None,
    scene: Scene = None,
    seed: Seed = None,
    settings: LabFile = None,
    json: Json = False,
) -> None:
    """Draw random trajectories that are reachable and free of collisions.

    Example: acqd lab trajectories --out trajectories --seed 7
    """
    from acqd.lab.campaign.trajectory_set import draw, write
    from acqd.lab.cell import build_cell
    from acqd.lab.report.trajectories import trajectories_report
    from acqd.lab.settings import LabSettings

    given = {"robot": robot, "scene": scene, "seed": seed}
    if cube is not None:
        given["cube"] = {"centre": cube[:3], "edge": cube[3]}  # type: ignore[assignment]
    cell = build_cell(settings_from(LabSettings, settings, given, []))
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out} exists and is not an empty folder; choose another --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
        out.rmdir()  # only a check that it can be made: no folder remains if drawing fails
    except OSError as error:
        raise UserError(f"{out}: cannot be made ({error.strerror}); choose another --out") from None
    console = terminal(stderr=True)
    with progress(console) as show_step:
        drawn = draw(
            cell,
            limited=limited if space is not Space.ALL else 0,
            all_space=all_space if space is not Space.LIMITED else 0,
            thesis=thesis,
            progress=lambda share: show_step("drawing", share),
        )
        try:
            write(drawn, cell, out)
            report = trajectories_report(cell, drawn, out)
        except OSError:
            shutil.rmtree(out, ignore_errors=True)
            raise
    if json:
        print(orjson.dumps({"out": str(out), "report": str(report), **drawn.summary()}).decode())
        return
    for name, tally in drawn.summary().items():
        print(
            f"{name}: {tally['trajectories']} trajectories, {tally['points']} points; "
            f"rejected draws: {tally['unreachable']} unreachable, {tally['colliding']} colliding"
        )
    print(f"{out}: CSV files in degrees; figures in {report}")
