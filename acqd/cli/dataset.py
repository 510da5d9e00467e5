"""`acqd dataset`: merges power rows and robot logs on a common time vector."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import orjson
import typer

from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import require
from acqd.report.digits import percent

if TYPE_CHECKING:
    from acqd.dataset.config import BuildReport

app = typer.Typer(no_args_is_help=True)


class Torque(StrEnum):
    """Source of the joint torques."""

    MEASURED = "measured"
    MODEL = "model"
    CURRENT = "current"


@app.callback()
def dataset() -> None:
    """Merge power rows with robot logs whose clocks nobody synchronised."""
    require("acqd dataset", ("jinja2", "matplotlib", "scipy"), "data")


@app.command()
def build(
    power: Annotated[
        str, typer.Option(help="SQL URL; a .sqlite, .csv, .jsonl or .parquet file of rows; log: in the logs.")
    ],
    logs: Annotated[Path, typer.Option(help="Folder of robot logs, or one log.")],
    out: Annotated[Path, typer.Option(help="Folder of the dataset.")],
    robot: Annotated[
        str | None, typer.Option(help="Shipped robot, or a description's path (default iiwa7_r800).")
    ] = None,
    device: Annotated[str | None, typer.Option(help="Device of the power rows, if there are several.")] = None,
    channel: Annotated[str | None, typer.Option(help="Channel of the power rows (default total, else L1).")] = None,
    torque: Annotated[
        Torque | None, typer.Option(help="Torques for the alignment (default: measured, else model).")
    ] = None,
    search: Annotated[float, typer.Option(min=0.1, help="s within which lags are searched first.")] = 2.4,
    step: Annotated[float | None, typer.Option(min=0.005, max=10, help="s between rows (default 0.04).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the split.")] = 1,
    lag: Annotated[float | None, typer.Option(help="s that the robot's clock is ahead, if known.")] = None,
    cut: Annotated[
        str | None,
        typer.Option(metavar="SECONDS|auto", help="Cut logs into pieces; default: one long log, if aligned; 0: none."),
    ] = None,
    append: Annotated[
        bool, typer.Option("--append", help="Put the recordings into the dataset, which exists.")
    ] = False,
    zone: Annotated[str | None, typer.Option(help="Zone of power times that name none, such as Europe/Berlin.")] = None,
    worked: Annotated[
        float, typer.Option(min=0, metavar="MINUTES", help="That the robot had worked before: its gears are warm.")
    ] = 0.0,
    json: Json = False,
) -> None:
    """Find each log's time shift, merge it with its power, and write Parquet with provenance.

    A log that cannot be used is named and left out; the exit code is 0 if any log could be used.

    Example: acqd dataset build --power campaign/power.sqlite --logs campaign/logs --out ds
    """
    from acqd.dataset.build import BuildConfig
    from acqd.dataset.build import build as run
    from acqd.dataset.manifest import load_manifest
    from acqd.dataset.regressors import TorqueSource

    source: TorqueSource | None = torque.value if torque is not None else None
    usual: dict[str, Any] = load_manifest(out) if append else {"description": "iiwa7_r800", "step_s": 0.04}
    description, step_s = str(robot or usual["description"]), float(step or usual["step_s"])
    length = cut_length(cut)
    build_config = BuildConfig(
        power,
        logs,
        out,
        description,
        device,
        channel,
        source,
        search,
        step_s,
        seed,
        lag,
        length,
        append,
        zone,
        worked,
    )
    console = terminal(stderr=True)
    assumed = f"--robot was not given: the logs were read as those of {description}" * (robot is None and not append)
    with progress(console) as show_step:
        try:
            report = run(build_config, show_step)
        except UserError as error:
            of_robot = any(text in str(error) for text in (description, "--robot", "logs can be used"))
            if assumed and of_robot:
                raise UserError(f"{error}; {assumed}") from None
            raise
    for line in [*filter(None, [assumed]), *report.refused, *report.notes]:
        console.print(f"acqd: {line}")
    print(orjson.dumps(report).decode() if json else summary(report, lag, power))


def cut_length(text: str | None) -> float | Literal["auto"] | None:
    """The value of --cut. Raises UserError."""
    if text is None:
        return None
    if text == "auto":
        return "auto"
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not (seconds == 0 or 2.5 <= seconds < float("inf")):
        raise UserError(f"--cut {text}: expected auto, 0, or at least 2.5 s")
    return seconds


def summary(report: BuildReport, lag: float | None, power: str) -> str:
    """What a build has made, in one line or two."""
    clock = "no common clock found" if lag is None else f"lag given, {lag} s"
    if report.own_lags_s:
        ends = sorted({f"{each:+.2f}" for each in (min(report.own_lags_s), max(report.own_lags_s))}, key=float)
        clock = f"no common clock found: every recording by its own lag, {' to '.join(ends)} s"
    if power == "log":
        clock = "power from the logs, no alignment needed"
    elif report.offset_s is not None:
        clock = (
            f"robot clock {report.offset_s:+.3f} s off, {report.drift_ppm:+.1f} ppm, scatter {report.scatter_ms:.1f} ms"
        )
    parts = ", ".join(f"{count} {part}" for part, count in report.split.items())
    label = f" ({report.measured})" if report.measured != "mains" else ""
    more = "further " if report.version > 1 else ""
    text = f"{report.out}{label}: {report.recordings} {more}recordings, {report.seconds / 3600:.2f} h; {parts}; {clock}"
    if report.known:
        text += f"; {report.known} logs were there already"
    return text + (f"\n{len(report.refused)} logs refused, see above" if report.refused else "")


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
    console = terminal(tables=True)
    table = Table("recording", "split", "seconds", "lag [s]", "by", "own lag [s]", "R2", "stands out")
    for entry in manifest["recordings"]:
        own = entry["own_lag"]
        cells = (f"{entry['valid_s']:.1f}", f"{entry['lag_s']:.4f}", entry["lag_by"])
        found = (f"{own['s']:.4f}", f"{own['r2']:.3f}", f"{own['stands_out']:.1f}")
        computed = entry["lag_by"] not in ("given", "table")
        table.add_row(entry["name"], entry["split"], *cells, *(found if computed else ("-", "-", "-")))
    console.print(table)
    label = f"{manifest['measured']}, " if manifest["measured"] != "mains" else ""
    version = f"version {manifest['version']}, " if manifest.get("version", 1) > 1 else ""
    console.print(
        f"{manifest['robot']}, {version}{label}{len(manifest['recordings'])} recordings, "
        f"{percent(valid_share(manifest))} of the rows valid, {len(manifest['refused'])} logs refused"
    )
