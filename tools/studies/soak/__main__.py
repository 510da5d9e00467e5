"""Hours of running: does anything grow?

    python -m tools.studies.soak [--minutes 240] [--bed mosquitto+postgres] [--picture FILE] [--json]

Daemon (simulated source, full rate), broker, sink and a sidecar run with the memory limits of their units. Every five
minutes their connections to the broker are reset, and the daemon's is half-open for ten seconds: leaks are often in
reconnecting. Robot logs arrive evenly over the run. Resident memory, descriptors, threads, log lines and the spool are
sampled and compared with budgets; in the end every row is compared with SQL. Exit 1 when a budget is exceeded.
"""

from __future__ import annotations

import json as json_
import random
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from acqd.cli.main import for_people
from acqd.errors import OperationError, UserError
from tools.bench.report import Figure, table
from tools.common.ending import end_in_order
from tools.common.tables import show
from tools.studies.faults.__main__ import kinds_of
from tools.studies.faults.bed import Bed, Extras, Kind
from tools.studies.faults.campaign import forget, recovered, settle
from tools.studies.faults.logs import LOG_DEVICE, LOGS
from tools.studies.faults.reconcile import reconcile
from tools.studies.soak.budgets import figures
from tools.studies.soak.picture import draw
from tools.studies.soak.usage import Sampler, folder_size

_CUT_EVERY_S, _CUT_S = 300.0, 10.0
_JUDGED = ("daemon", "sink", "sidecar", "broker")
_NONE = ("lost", "unspooled", "duplicated", "wrong", "unflagged", "backwards", "energy_back")


def soak(
    minutes: Annotated[float, typer.Option(min=1, help="How long.")] = 240.0,
    bed: Annotated[str, typer.Option(help="Broker and database, as in tools.studies.faults.")] = "mosquitto+postgres",
    picture: Annotated[Path | None, typer.Option(help="Draw memory over time into this file (.svg, .png).")] = None,
    keep: Annotated[Path | None, typer.Option(help="Keep tapes, logs and databases in this new folder.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Run everything for hours and compare what it takes with budgets.

    Example: python -m tools.studies.soak --minutes 30 --picture memory.svg
    """
    end_in_order()
    if keep is not None and keep.exists():
        raise UserError(f"--keep {keep} exists; name a new folder")
    [kind] = kinds_of([bed])
    place = keep or Path(tempfile.mkdtemp(prefix="acqd-soak-"))
    try:
        sampler, found = _run(kind, place / "bed", 60 * minutes)
    finally:
        if keep is None:
            forget(place)
    if picture is not None:
        draw(sampler, picture)
    if json:
        print(json_.dumps([asdict(figure) | {"met": figure.met} for figure in found]))
    else:
        show(table(found, f"{minutes:g} min on {kind} (simulated source)"), width=120)
    raise SystemExit(0 if all(figure.met is not False for figure in found) else 1)


def _run(kind: Kind, folder: Path, seconds: float) -> tuple[Sampler, list[Figure]]:
    bed = Bed(kind, folder, Extras(sidecar=True))
    try:
        bed.start()
        if recovered(bed) is None:
            raise OperationError(f"no row is stored within 30 s; see {bed.daemon.log} (--keep)")
        spool = {"daemon": lambda: folder_size(bed.folder / "state", "spool-*/*.seg")}
        sampler = Sampler(dict(bed.services()), min(10.0, seconds / 60), spool)
        _pass(bed, seconds, sampler)
        sampler.stop()
        settle(bed)
        found = [line for name in _JUDGED if (s := sampler.of(name)) for line in figures(name, s)]
        return sampler, found + _judged(bed)
    finally:
        bed.stop()


def _pass(bed: Bed, seconds: float, sampler: Sampler) -> None:
    """Let the time pass, with logs and cuts."""
    assert bed.logs is not None
    console, chance, logs, cuts = Console(stderr=True), random.Random(1), 0, 0
    with Progress(console=console, disable=not console.is_terminal) as progress:
        bar, said = progress.add_task("soak", total=seconds), 0.0
        while (passed := sampler.elapsed_s) < seconds:
            progress.update(bar, completed=passed)
            if passed > logs * seconds / LOGS:
                bed.logs.arrive(chance)
                logs += 1
            if passed > (cuts + 1) * _CUT_EVERY_S:
                _cut(bed)
                cuts += 1
            if not console.is_terminal and passed > said:
                console.print(_line(sampler, passed), highlight=False, soft_wrap=True)
                said += seconds / 20
            time.sleep(1.0)


def _cut(bed: Bed) -> None:
    """Reset all connections; then the daemon's is half-open."""
    for proxy in bed.proxies.values():
        proxy.reset()
    time.sleep(_CUT_S)
    bed.proxies["daemon"].mode = "silent"
    time.sleep(_CUT_S)
    bed.proxies["daemon"].mode = "pass"


def _line(sampler: Sampler, passed: float) -> str:
    now = {sample.name: sample.usage.rss / 1e6 for sample in list(sampler.samples)}
    return f"{passed:7.0f} s  " + ", ".join(f"{name} {memory:.1f} MB" for name, memory in now.items())


def _judged(bed: Bed) -> list[Figure]:
    """Rows, logs and deaths."""
    assert bed.logs is not None
    rows, section = reconcile(bed.tapes, bed.engine, beside=LOG_DEVICE), "rows and logs"
    deaths = sum(process.deaths for _, process in bed.services())
    return [
        Figure(section, "rows made", rows.made, ""),
        *(Figure(section, f"rows {name}", getattr(rows, name), "", "<= 0") for name in _NONE),
        Figure(section, "logs arrived", bed.logs.judge(bed.engine).arrived, ""),
        Figure(section, "logs not done exactly once", bed.logs.judge(bed.engine).wrong, "", "<= 0"),
        Figure(section, "processes that ended by themselves", deaths, "", "<= 0"),
    ]


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(soak)
    for_people(app)
