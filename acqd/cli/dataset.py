"""`acqd dataset`: merges power rows and robot logs on a common time vector."""

from __future__ import annotations

from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from acqd.cli.options import Json
from acqd.errors import UserError

app = typer.Typer(no_args_is_help=True)


class Torque(StrEnum):
    """Source of the joint torques."""

    MEASURED = "measured"
    MODEL = "model"
    CURRENT = "current"


@app.callback()
def dataset() -> None:
    """Merge power rows with robot logs whose clocks nobody synchronised."""
    missing = [name for name in ("pyarrow", "scipy") if find_spec(name) is None]
    if missing:
        raise UserError(f"acqd dataset needs {' and '.join(missing)}: install acqd[data]")


@app.command()
def build(
    power: Annotated[str, typer.Option(help="SQL URL, or a .sqlite, .csv, .jsonl or .parquet file of rows.")],
    logs: Annotated[Path, typer.Option(help="Folder of robot logs, or one log.")],
    out: Annotated[Path, typer.Option(help="Folder of the dataset.")],
    robot: Annotated[str, typer.Option(help="Shipped robot, or a description's path.")] = "iiwa7_r800",
    device: Annotated[str | None, typer.Option(help="Device of the power rows, if there are several.")] = None,
    channel: Annotated[str | None, typer.Option(help="Channel of the power rows (default total, else L1).")] = None,
    torque: Annotated[
        Torque | None, typer.Option(help="Torques for the alignment (default: measured, else model).")
    ] = None,
    search: Annotated[float, typer.Option(min=0.1, help="s within which lags are searched first.")] = 2.4,
    step: Annotated[float, typer.Option(min=0.005, max=10, help="s between rows.")] = 0.04,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the split.")] = 1,
    lag: Annotated[float | None, typer.Option(help="s that the robot's clock is ahead, if known.")] = None,
    cut: Annotated[float | None, typer.Option(min=2.5, help="s: length of pieces to cut long logs into.")] = None,
    json: Json = False,
) -> None:
    """Find each log's time shift, merge it with its power, and write Parquet with provenance.

    Example: acqd dataset build --power campaign/power.sqlite --logs campaign/logs --out ds
    """
    from acqd.dataset.build import BuildConfig, BuildReport
    from acqd.dataset.build import build as run
    from acqd.dataset.regressors import TorqueSource

    source: TorqueSource | None = torque.value if torque is not None else None
    build_config = BuildConfig(power, logs, out, robot, device, channel, source, search, step, seed, lag, cut)
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task("reading", total=1.0)
        report: BuildReport = run(
            build_config, lambda what, share: progress.update(bar, description=what, completed=share)
        )
    for line in [*report.refused, *report.notes]:
        console.print(f"acqd: {line}", soft_wrap=True, highlight=False)
    if json:
        print(orjson.dumps(report).decode())
        return
    clock = "no common clock found: every recording by its own lag" if lag is None else f"lag given, {lag} s"
    if report.offset_s is not None:
        clock = (
            f"robot clock {report.offset_s:+.3f} s off, {report.drift_ppm:+.1f} ppm, scatter {report.scatter_ms:.1f} ms"
        )
    parts = ", ".join(f"{count} {part}" for part, count in report.split.items())
    label = f" ({report.measured})" if report.measured != "mains" else ""
    print(f"{report.out}{label}: {report.recordings} recordings, {report.seconds / 3600:.2f} h; {parts}; {clock}")
    if report.refused:
        print(f"{len(report.refused)} logs refused, see above")


@app.command()
def show(path: Annotated[Path, typer.Argument(metavar="DS", help="Folder of a dataset.")], json: Json = False) -> None:
    """List a dataset's recordings with their time shifts.

    Example: acqd dataset show ds
    """
    from acqd.dataset.manifest import load_manifest, valid_share

    manifest = load_manifest(path)
    if json:
        print(orjson.dumps(manifest).decode())
        return
    console = Console(soft_wrap=True)
    console.width = max(console.width, 110)
    table = Table("recording", "split", "seconds", "lag \\[s]", "by", "own lag \\[s]", "R2", "stands out")
    for entry in manifest["recordings"]:
        own = entry["own_lag"]
        cells = (f"{entry['valid_s']:.1f}", f"{entry['lag_s']:.4f}", entry["lag_by"], f"{own['s']:.4f}")
        table.add_row(entry["name"], entry["split"], *cells, f"{own['r2']:.3f}", f"{own['stands_out']:.1f}")
    console.print(table)
    label = f"{manifest['measured']}, " if manifest["measured"] != "mains" else ""
    console.print(
        f"{manifest['robot']}, {label}{len(manifest['recordings'])} recordings, "
        f"{valid_share(manifest):.1%} of the rows valid, {len(manifest['refused'])} logs refused"
    )
