"""`acqd robot ability`: what recordings of a motion can tell, before they are made."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.console import Console

from acqd.atomic import require_page
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.extras import require
from acqd.report.joint_names import all_with_joint_names, with_joint_names


def ability(
    model: Annotated[Path, typer.Argument(metavar="BUNDLE", help="Grey-box model of the robot as it is.")],
    motion: Annotated[
        Path | None,
        typer.Option(
            metavar="DS|LOG|PROGRAM",
            help="Dataset, robot log or laboratory program with the motion (default: what the model remembers).",
        ),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(min=0.5, max=525_600, help="Minutes to record of that motion (default as long as it is)."),
    ] = None,
    html: Annotated[Path | None, typer.Option(metavar="FILE", help="Also write the tables as a page.")] = None,
    json: Json = False,
) -> None:
    """Show the smallest size of every effect that recordings of a motion can tell, and which effects look alike.

    The power of the recordings to come is predicted by the model, with the residual of its reference. A second table
    says what would help most: more minutes, torques, or a signal that the recordings lack.

    Example: acqd robot ability ds0.models/grey-box-everything-s1 --minutes 10
    """
    require("acqd robot ability", ("scipy",), "loop")
    from acqd.discrepancy.ability.ability import table_of
    from acqd.discrepancy.beforehand import beforehand

    if html is not None:
        require_page(html, "--html")
    with progress(Console(stderr=True)) as shown:
        planned = beforehand(model, motion, minutes, shown)
    if html is not None:
        from acqd.discrepancy.report.beforehand_page import write_page
        from acqd.report.chain import REPORT, connect

        write_page(html, planned)
        connect(html, [model.parent / REPORT])
    if json:
        said = planned.as_json() | ({"page": str(html)} if html else {})
        print(orjson.dumps(said, option=orjson.OPT_SERIALIZE_NUMPY).decode())
        return
    console = terminal(soft_wrap=False, tables=True)
    console.print(f"{planned.minutes:.1f} min of the motion of {planned.motion}; told from nothing in 95 %")
    console.print(_folded(all_with_joint_names(table_of(planned.ability), planned.joints)))
    for name, why in planned.ability.unseen:
        console.print(f"not judged: {name} ({why})")
    console.print(_folded(all_with_joint_names(planned.choices_table, planned.joints)))
    for sentence in planned.says:
        console.print(with_joint_names(sentence, planned.joints))
    if html is not None:
        console.print(f"page: {html}", markup=False)


def _folded(rows: list[list[str]]) -> Table:
    """Names in the first column are not folded."""
    header, *values = rows
    table = Table(*header)
    table.columns[0].no_wrap, table.columns[0].min_width = True, max(len(row[0]) for row in rows)
    for row in values:
        table.add_row(*row)
    return table
