"""`acqd compare`: models beside each other on held-out recordings."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from acqd.cli.models.places import default_models
from acqd.cli.options import Json
from acqd.errors import UserError


def compare(
    dataset: Annotated[Path, typer.Argument(metavar="DS", help="Folder of a dataset.")],
    models: Annotated[Path | None, typer.Option(help="Folder of bundles, or one (default DS.models).")] = None,
    out: Annotated[Path | None, typer.Option(help="HTML report (default report.html beside the bundles).")] = None,
    json: Json = False,
) -> None:
    """Compare models on recordings that none of them has seen; one HTML report.

    Example: acqd compare ds --out report.html
    """
    missing = [name for name in ("matplotlib", "pyarrow", "scipy", "safetensors") if find_spec(name) is None]
    if missing:
        raise UserError(f"acqd compare needs {' and '.join(missing)}: install acqd[model]")
    from acqd.models.compare.evaluate import compare as run
    from acqd.models.compare.report import as_json, write_report
    from acqd.models.segments import load_dataset

    folder = models or default_models(dataset)
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("predicting", total=1.0)
        found = run(
            load_dataset(dataset), folder, lambda what, share: bar.update(task, description=what, completed=share)
        )
    path = out or folder / "report.html"
    write_report(found, path)
    for note in found.notes:
        console.print(f"acqd: {note}", soft_wrap=True, highlight=False)
    if json:
        print(orjson.dumps(as_json(found) | {"report": str(path)}).decode())
        return
    table = Table("model", "trained on", "seeds", "MAE \\[W]", "95 %", "RMSE \\[W]", "energy p95", "unstable")
    for entry in sorted(found.entries, key=lambda e: e.metrics["everything"].mae) + found.baselines:
        m = entry.metrics["everything"]
        low, high = entry.mae_ci95
        cells = (f"{m.mae:.2f}", f"{low:.2f} to {high:.2f}", f"{m.rmse:.2f}", f"{100 * m.energy_p95:.2f} %")
        table.add_row(entry.label, entry.trained_on, str(entry.seeds), *cells, f"{100 * entry.unstable:.2f} %")
    out_console = Console(soft_wrap=True)
    out_console.width = max(out_console.width, 100)
    out_console.print(table)
    floor = f"noise floor {found.floor_W:.2f} W MAE; " if found.floor_W is not None else ""
    out_console.print(f"{found.data.measured} power; {floor}report: {path}")
