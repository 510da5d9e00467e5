"""`acqd robot from-urdf`: a robot description from a URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import MOTION, require


def from_urdf(
    file: Annotated[Path, typer.Argument(metavar="FILE.urdf", help="A URDF; expand a xacro file first.")],
    out: Annotated[Path | None, typer.Option(help="File to write (default NAME.toml, of the robot's name).")] = None,
    base: Annotated[str | None, typer.Option(metavar="LINK", help="Link that stands still (default the root).")] = None,
    tip: Annotated[
        str | None, typer.Option(metavar="LINK", help="Link that carries tools (default the only end there is).")
    ] = None,
    json: Json = False,
) -> None:
    """Describe the arm of a URDF; drives, friction and accelerations are guessed and marked.

    Example: acqd robot from-urdf arm.urdf --tip tool0 --out arm.toml
    """
    require("acqd robot from-urdf", MOTION, "motion")
    from acqd.atomic import write_complete
    from acqd.robot.toml_text import description_text
    from acqd.robot.urdf.describe import describe_urdf

    converted = describe_urdf(file, None if out is None else out.stem, base, tip)
    target = out or Path(f"{converted.robot.name}.toml")
    if target.suffix != ".toml":
        raise UserError(f"{target}: a robot description ends in .toml; choose another --out")
    if target.exists():
        raise UserError(f"{target} is there already; choose another --out")
    text = description_text(converted.table, [f"From {file.name} by acqd robot from-urdf.", *converted.notes])
    write_complete(target, text.encode())
    if json:
        joints = [joint.name for joint in converted.robot.joint]
        result = {"out": str(target), "robot": converted.robot.name, "joints": joints, "notes": converted.notes}
        print(orjson.dumps(result).decode())
        return
    console = terminal()
    console.print(f"{target}: {converted.robot.axes} axes, {', '.join(j.name for j in converted.robot.joint)}")
    for note in converted.notes:
        console.print(f"  {note}")
    console.print(f"next: acqd robot check {target} --out {target.with_suffix('.html')}")
