"""`acqd compare`: models on the same held-out recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.atomic import require_page
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.dataset.places import default_models
from acqd.extras import require
from acqd.report.digits import percent


def compare(
    dataset: Annotated[Path, typer.Argument(metavar="DS", help="Folder of a dataset.")],
    models: Annotated[Path | None, typer.Option(help="Folder of bundles, or one bundle (default DS.models).")] = None,
    out: Annotated[Path | None, typer.Option(help="HTML report (default: report.html with the bundles).")] = None,
    json: Json = False,
) -> None:
    """Compare models on recordings that none of them was trained on, and write an HTML report.

    Example: acqd compare ds --out report.html
    """
    require("acqd compare", ("jinja2", "matplotlib", "safetensors", "scipy"), "data,predict")
    from acqd.models.compare.evaluate import compare as run
    from acqd.models.compare.report import as_json, write_report
    from acqd.models.segments import load_dataset
    from acqd.report.chain import REPORT, connect

    folder = models or default_models(dataset)
    path = out or folder / "report.html"
    require_page(path)
    console = terminal(stderr=True)
    with progress(console) as show_step:
        comparison = run(load_dataset(dataset), folder, show_step)
    write_report(comparison, path)
    connect(path, [dataset / REPORT])
    for note in comparison.notes:
        console.print(f"acqd: {note}")
    if json:
        print(orjson.dumps(as_json(comparison) | {"report": str(path)}).decode())
        return
    table = Table("model", "trained on", "seeds", "MAE [W]", "95 %", "RMSE [W]", "energy p95", "unstable")
    for entry in sorted(comparison.entries, key=lambda e: e.metrics["everything"].mae) + comparison.baselines:
        m = entry.metrics["everything"]
        low, high = entry.mae_ci95
        cells = (f"{m.mae:.2f}", f"{low:.2f} to {high:.2f}", f"{m.rmse:.2f}", percent(m.energy_p95))
        table.add_row(entry.name, entry.trained_on, str(entry.seeds), *cells, percent(entry.unstable))
    out_console = terminal()
    out_console.width = max(out_console.width, 100)
    out_console.print(table)
    out_console.print(
        f"{comparison.data.measured} power; noise floor {comparison.floor_W:.2f} W MAE, {comparison.floor_where}; "
        f"report: {path}"
    )
