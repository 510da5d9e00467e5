"""`acqd conformance`: the test points of the standards, by simulation, for a terminal."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer
from rich.console import Console
from rich.text import Text

from acqd.atomic import require_page
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal as console_of
from acqd.errors import UserError
from acqd.extras import require

if TYPE_CHECKING:
    from acqd.conformance.sheet import Sheet


def conformance(
    terminal: Annotated[
        Path | None, typer.Option(help="TOML file that describes the terminal; default: EL3783, 5 A, 230 V, 50 Hz.")
    ] = None,
    only: Annotated[list[str] | None, typer.Option(help="Groups of points, such as energy; several times.")] = None,
    out: Annotated[Path | None, typer.Option(help="HTML report with pictures.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, max=64, help="Processes; default: as many as cores.")] = None,
    json: Json = False,
) -> None:
    """Meter the test signals of the standards and print the sheet; exit 1 when a point fails.

    By simulation; converter and transformers are not included unless the terminal's file describes them.

    Example: acqd conformance --terminal box.toml --out sheet.html
    """
    if out is not None:
        require_page(out)
        require("acqd conformance --out", ("jinja2",), "lab")
    from acqd.conformance.sheet import GROUPS, make_sheet
    from acqd.conformance.terminal import Terminal, load_terminal

    unknown = [name for name in only or () if name not in GROUPS]
    if unknown:
        raise UserError(f"--only {unknown[0]}: unknown; expected one of {', '.join(GROUPS)}")
    described = load_terminal(terminal) if terminal is not None else Terminal()
    with progress(Console(stderr=True)) as report:
        sheet = make_sheet(described, only or list(GROUPS), jobs or os.cpu_count() or 1, report)
    if out is not None:
        from acqd.conformance.page import sheet_page

        sheet_page(sheet).write(out)
    if json:
        print(orjson.dumps(sheet.as_json() | {"report": None if out is None else str(out)}).decode())
    else:
        _print(sheet)
        if out is not None:
            print(f"report: {out}")
    if not sheet.passed:
        raise typer.Exit(1)


def _print(sheet: Sheet) -> None:
    from acqd.conformance.sheet import LABEL

    console = console_of(tables=True)
    for standard in dict.fromkeys(point.standard for point in sheet.points):
        table = Table("parameter", "test signal", "quantity", "largest error", "limit", "", title=standard)
        table.title_justify = "left"
        for one in (point for point in sheet.points if point.standard == standard):
            error = f"{one.error:.3g}" if one.readings and one.error == one.error else "missing"
            state = Text("passed", "green") if one.passed else Text("FAILED", "red")
            limit = f"{one.limit.value:g} {one.limit.unit}"
            table.add_row(one.parameter, one.signal, one.quantity, error, limit, state)
        console.print(table)
    for budget in sheet.budgets:
        kept = {True: "within", False: "BEYOND", None: "no"}[budget.passed]
        limit = f"limit {budget.limit.value:g} {budget.limit.unit}" if budget.limit else "limit known"
        console.print(f"{budget.quantity}: U = {budget.expanded:.3g} {budget.unit} (k = 2), {kept} {limit}")
    for one in sheet.failed:
        console.print(f"FAILED: {one.standard}: {one.parameter}: {one.quantity}: {one.signal}", style="red")
    count = len(sheet.points)
    console.print(f"{count - len(sheet.failed)} of {count} points passed for {sheet.terminal.name}. {LABEL}")
    console.print("docs/conformance.md says what the sheet leaves out, and why.")
