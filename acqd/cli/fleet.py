"""`acqd fleet`: dataset, watch and loop for many robots."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.atomic import require_writable
from acqd.cli.folded_table import Table
from acqd.cli.options import Json, mean_price
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.extras import LOOP, require

if TYPE_CHECKING:
    from acqd.fleet.summary import FleetReport


class Engine(StrEnum):
    """What works on several robots at the same time."""

    PROCESS = "process"
    RAY = "ray"


def fleet(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="TOML file that names the robots.")],
    out: Annotated[Path | None, typer.Option(help="Folder of the results (default FILE.fleet).")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Robots at the same time (default one per core).")] = None,
    engine: Annotated[Engine, typer.Option(help="Local processes, or a Ray cluster.")] = Engine.PROCESS,
    ray_address: Annotated[str | None, typer.Option(help="Address of the Ray cluster (default: start one).")] = None,
    tariff: Annotated[
        Path | None, typer.Option(help="TOML file with prices: what causes cost a year (default: the configuration's).")
    ] = None,
    everybody: Annotated[bool, typer.Option("--all", help="Also list the robots that have not changed.")] = False,
    json: Json = False,
) -> None:
    """Find out which robots of a fleet have changed, since when, why, and what they share.

    Every robot's dataset is brought up to date and screened. The loop is closed on the robots that have changed, at a
    controlled rate of false discoveries. An interrupted run continues; the exit code is 1 if a robot failed.

    Example: acqd fleet plant.toml --jobs 4
    """
    require("acqd fleet", LOOP, "loop")
    from acqd.dataset.places import default_folder
    from acqd.fleet.config import read_fleet
    from acqd.fleet.run import FleetConfig, run_fleet

    described = read_fleet(file)
    folder = out or default_folder(file.with_suffix(""), "fleet")
    require_writable(folder)
    price = mean_price(tariff)
    config = FleetConfig(described, folder, jobs or os.cpu_count() or 1, engine.value, ray_address, price)
    with progress(terminal(stderr=True)) as show:
        report = run_fleet(config, show)
    if json:
        result = report.as_json() | {"out": str(folder), "page": str(folder / "report.html")}
        print(orjson.dumps(result, option=orjson.OPT_SERIALIZE_NUMPY).decode())
    else:
        _print(report, folder, everybody=everybody)
    if report.failed:
        raise typer.Exit(1)


def _print(report: FleetReport, folder: Path, *, everybody: bool) -> None:
    from acqd.fleet import words

    console = terminal(tables=True)
    failed = [row for row in report.robots if row["state"] == "failed"]
    unchanged = [row for row in report.robots if row["state"] == "unchanged"]
    console.print(
        f"{len(report.robots)} robots: {len(report.changed)} changed, {len(unchanged)} without a change, "
        f"{len(failed)} not judged"
    )
    for number, each in enumerate(report.shared, start=1):
        console.print(words.shared_line(number, each))
        console.print(f"  in {', '.join(each['robots'])}; {len(each['excepted'])} robots are excepted")
    rows = [*report.changed, *failed, *(unchanged if everybody else [])]
    if rows:
        table = Table("robot", "state", "since (UTC)", "what", "how much", "how sure", "shared")
        for row in rows:
            cells = (row["name"], words.STATES[row["state"]], words.since(row), words.what(row), words.how_much(row))
            table.add_row(*cells, words.how_sure(row), str(row["shared"] or ""))
        console.print(table)
    console.print(f"report: {folder / 'report.html'}")
