"""`acqd energy work`: energy of cycles, and by program, step, part and state."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.atomic import write_table
from acqd.cli.energy.outputs import check_outputs
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import require

if TYPE_CHECKING:
    from collections.abc import Sequence

    from acqd.work.cycle_energy import CycleEnergy
    from acqd.work.labels import Labelled

_CYCLE = "cycle"


def work(
    dataset: Annotated[Path, typer.Argument(metavar="DS", help="Folder of a dataset.")],
    by: Annotated[str, typer.Option(help="cycle, program, step, part or state.")] = _CYCLE,
    csv: Annotated[Path | None, typer.Option(help="CSV file: a line a cycle, or a line a value.")] = None,
    html: Annotated[Path | None, typer.Option(help="HTML report with pictures.")] = None,
    json: Json = False,
) -> None:
    """What a cycle, a program, a step or a part takes: cycles are found in the motion, the others are columns of logs.

    Example: acqd energy work ds --html cycles.html
    """
    check_outputs("acqd energy work", csv, html)
    require("acqd energy work", ("scipy",), "data")
    from acqd.models.segments import load_dataset
    from acqd.robot.log_layout import LABELS
    from acqd.work.joined import joined

    if by not in (_CYCLE, *LABELS):
        raise UserError(f"--by {by!r}: expected {', '.join((_CYCLE, *LABELS))}")
    data = load_dataset(dataset)
    segments = joined(data.segments, data.step_s)
    title, simulated = f"{data.robot}, {dataset.name}", data.measured == "simulated"
    if by == _CYCLE:
        from acqd.work import tables
        from acqd.work.cycle_energy import cycle_energy

        cycles = cycle_energy(segments, data.step_s)
        told, text = tables.cycles_json(cycles), tables.cycles_csv(cycles)
    else:
        from acqd.work import tables
        from acqd.work.labels import labelled

        values = labelled(segments, by, data.step_s, dataset)
        told, text = tables.labels_json(by, values), tables.labels_csv(by, values)
    if csv is not None:
        write_table(csv, text)
    if html is not None:
        from acqd.report.chain import REPORT, connect
        from acqd.work.page import cycles_page, labels_page

        page = (
            cycles_page(title, cycles, simulated=simulated)
            if by == _CYCLE
            else labels_page(title, by, values, simulated=simulated)
        )
        page.detail("dataset", dataset)
        page.detail("dataset SHA-256", data.digest)
        page.write(html)
        connect(html, [dataset / REPORT])
    if json:
        files = {"csv": csv and str(csv), "html": html and str(html)}
        print(orjson.dumps({"dataset": str(dataset), "measured": data.measured} | told | files).decode())
        return
    if by == _CYCLE:
        _print_cycles(cycles, data.measured)
    else:
        _print_labels(by, values, data.measured)
    for written in (csv, html):
        if written is not None:
            print(f"written: {written}")


def _origin(measured: str) -> str:
    return "" if measured == "mains" else f" ({measured} power)"


def _print_cycles(energy: CycleEnergy, measured: str) -> None:
    from acqd.report.digits import duration, percent, quantity
    from acqd.work.tables import KIND_HEADER, cycle_cells, kind_cells, kinds

    console = terminal(tables=True)
    if energy.cycles:
        table = Table(*KIND_HEADER, title=f"{len(energy.cycles)} cycles{_origin(measured)}", title_justify="left")
        for kind, cycles in kinds(energy).items():
            table.add_row(*kind_cells(kind, cycles))
        console.print(table)
    else:
        console.print(f"no cycles: the motion of these recordings does not repeat{_origin(measured)}")
    for each in energy.cycles:
        if each.outlier:
            console.print("outlier: " + ", ".join(cycle_cells(each)))
    for between in energy.between:
        share = percent(between.kWh / energy.kWh) if energy.kWh else "-"
        console.print(
            f"outside of cycles, {between.name}: {quantity(1000 * between.kWh, 'Wh', 3)} ({share}) in "
            f"{duration(between.seconds)}"
        )


def _print_labels(by: str, values: Sequence[Labelled], measured: str) -> None:
    from acqd.work.tables import LABEL_HEADER, label_cells

    table = Table(by, *LABEL_HEADER, title=f"by {by}{_origin(measured)}", title_justify="left")
    for each in values:
        table.add_row(*label_cells(each))
    terminal(tables=True).print(table)
