"""A broker that is away for an hour: nothing lost, the memory flat, new rows in time while the backlog is delivered.

    python -m tools.studies.soak.outage [--minutes 60] [--memory 256] [--bed mosquitto+postgres] [--json]

The daemon meters at full rate (simulated source, 4 channels, 25 rows/s each) under a memory limit. A second subscriber
sees when rows come and in which order. Every row of the daemon's tape is compared with SQL. Exit 1 when a target is
missed.
"""

from __future__ import annotations

import json as json_
import math
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import orjson
import sqlalchemy as sa
import typer
from rich.console import Console

from acqd.cli.main import for_people
from acqd.errors import OperationError, UserError
from acqd.storage.schema import power
from tools.bench.report import Figure, table
from tools.common.ending import end_in_order
from tools.common.tables import show
from tools.studies.faults.__main__ import kinds_of
from tools.studies.faults.bed import DEVICE, Bed, Extras, Kind
from tools.studies.faults.campaign import forget, recovered, settle
from tools.studies.faults.memory import how
from tools.studies.faults.process import Process
from tools.studies.faults.reconcile import Reconciled, reconcile
from tools.studies.soak.listener import Listener, out_of_order
from tools.studies.soak.picture import draw
from tools.studies.soak.usage import Sampler, folder_size

_WARM_S, _AFTER_S = 60.0, 15.0
_DELIVERY_S = 1_800.0
"""Longest time to wait for the backlog."""
_MB = 1e6
_NONE = (
    "lost",
    "unspooled",
    "duplicated",
    "wrong",
    "unflagged",
    "backwards",
    "energy_back",
    "out_of_order",
    "daemon_died",
)


def outage(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long the broker is away.")] = 60.0,
    memory: Annotated[int, typer.Option(min=100, help="Memory limit of the daemon [MiB].")] = 256,
    bed: Annotated[str, typer.Option(help="Broker and database, as in tools.studies.faults.")] = "mosquitto+postgres",
    picture: Annotated[Path | None, typer.Option(help="Draw memory over time into this file (.svg, .png).")] = None,
    keep: Annotated[Path | None, typer.Option(help="Keep tapes, logs and databases in this new folder.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Take the broker away, bring it back, and say what became of the rows.

    Example: python -m tools.studies.soak.outage --minutes 2
    """
    end_in_order()
    if keep is not None and keep.exists():
        raise UserError(f"--keep {keep} exists; name a new folder")
    [kind] = kinds_of([bed])
    place = keep or Path(tempfile.mkdtemp(prefix="acqd-outage-"))
    try:
        sampler, measured = _run(kind, place / "bed", 60 * minutes, memory)
    finally:
        if keep is None:
            forget(place)
    if picture is not None:
        draw(sampler, picture)
    figures = _figures(measured)
    if json:
        print(json_.dumps(measured | {"targets": {figure.name: figure.met for figure in figures}}))
    else:
        show(table(figures, "outage of the broker (simulated source)"), width=120)
    raise SystemExit(0 if all(figure.met is not False for figure in figures) else 1)


def _run(kind: Kind, folder: Path, away_s: float, memory: int) -> tuple[Sampler, dict[str, Any]]:
    bed, console = Bed(kind, folder, Extras(daemon_memory=memory << 20)), Console(stderr=True)
    listener = None
    try:
        bed.start()
        if recovered(bed) is None:
            raise OperationError(f"no row is stored within 30 s; see {bed.daemon.log} (--keep)")
        time.sleep(min(_WARM_S, away_s))
        spool = {"daemon": lambda: folder_size(bed.folder / "state", "spool-*/*.seg")}
        sampler = Sampler({"daemon": bed.daemon, "sink": bed.sink}, min(5.0, away_s / 20), spool)
        bed.broker.stop()
        _wait(away_s, bed.daemon, sampler, console)
        bed.broker.start()
        back, back_s = time.time(), sampler.elapsed_s
        listener = Listener(bed.port, DEVICE)
        waiting, newest = _taped(bed)
        delivered_s = _delivered(bed, back, waiting, newest, console)
        time.sleep(_AFTER_S)
        sampler.stop()
        settle(bed)
        listener.stop()
        rows = reconcile(bed.tapes, bed.engine)
    finally:
        bed.stop()
    return sampler, _measured(sampler, listener, rows, back, back_s) | {
        "bed": str(kind), "away_s": away_s, "limit_MiB": memory, "limit": how(), "delivered_s": delivered_s,
        "backlog_rows": waiting, "daemon_died": bed.daemon.deaths,
    }  # fmt: skip


def _wait(seconds: float, process: Process, sampler: Sampler, console: Console) -> None:
    """Let the time pass, and say ten times how it goes. Raises OperationError when the daemon has ended."""
    for _ in range(10):
        time.sleep(seconds / 10)
        if process.running is None or process.running.poll() is not None:
            raise OperationError(f"the daemon has ended; see {process.log} (--keep)")
        last = sampler.of("daemon")[-1]
        console.print(
            f"{last.at_s:7.0f} s  daemon {last.usage.rss / _MB:.1f} MB, spool {last.stored / _MB:.1f} MB",
            highlight=False,
        )


def _taped(bed: Bed) -> tuple[int, int]:
    """Rows on the tape, and the filetime of the last one."""
    with bed.tape.open("rb") as file:
        rows = sum(piece.count(b"\n") for piece in iter(lambda: file.read(1 << 20), b""))
        file.seek(max(0, bed.taped() - 4096))
        last = file.read().split(b"\n")[-2]
    return rows, orjson.loads(last)["filetime"]


def _delivered(bed: Bed, since: float, rows: int, newest: int, console: Console) -> float | None:
    """Seconds until the rows made before the broker came back are stored; None: not within half an hour."""
    query = sa.select(sa.func.count()).select_from(power).where(power.c.filetime <= newest)
    shown = 0.0
    while (passed := time.time() - since) < _DELIVERY_S:
        with bed.engine.connect() as connection:
            stored = int(connection.execute(query).scalar_one())
        if stored >= rows:
            return round(passed, 1)
        if passed > shown:
            console.print(f"{passed:7.0f} s  {stored} of {rows} rows stored", highlight=False)
            shown = passed + 10
        time.sleep(0.5)
    return None


def _measured(sampler: Sampler, listener: Listener, rows: Reconciled, back: float, back_s: float) -> dict[str, Any]:
    memory = [sample.usage.rss / _MB for sample in sampler.of("daemon")]
    away = [sample.usage.rss / _MB for sample in sampler.of("daemon") if sample.at_s <= back_s]
    connected = min((made + late for made, late in listener.late), default=back)
    late = [seconds for made, seconds in listener.late if made > connected]
    return asdict(rows) | {
        "rss_first_MB": memory[0], "rss_away_MB": [min(away), max(away)], "rss_all_MB": [min(memory), max(memory)],
        "spool_MB": max(sample.stored for sample in sampler.of("daemon")) / _MB,
        "connected_s": connected - back, "new_rows": len(late), "late_worst_s": max(late, default=None),
        "late_p99_s": float(np.percentile(late, 99)) if late else None,
        "out_of_order": sum(out_of_order(numbers) for numbers in listener.numbers.values()),
    }  # fmt: skip


def _figures(measured: dict[str, Any]) -> list[Figure]:
    section = f"{measured['bed']}, {measured['away_s'] / 60:g} min without a broker"
    moved = max(abs(value - measured["rss_first_MB"]) for value in measured["rss_all_MB"])
    delivered, worst = measured["delivered_s"], measured["late_worst_s"]
    return [
        Figure(section, "rows made", measured["made"], ""),
        *(Figure(section, name, measured[name], "", "<= 0") for name in _NONE),
        Figure(section, "backlog", measured["backlog_rows"], "rows"),
        Figure(section, "backlog on disk", measured["spool_MB"], "MB"),
        Figure(section, "backlog stored after", math.inf if delivered is None else delivered, "s", "<= 300"),
        Figure(section, "new rows out of this connection", measured["new_rows"], ""),
        Figure(section, "new row to a subscriber meanwhile, worst", math.inf if worst is None else worst, "s", "<= 1"),
        Figure(section, "memory before", measured["rss_first_MB"], "MB"),
        Figure(section, "memory, largest change", moved, "MB", "<= 10"),
        Figure(section, "memory, most", measured["rss_all_MB"][1] / 1.048576, "MiB", f"<= {measured['limit_MiB']}"),
    ]


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(outage)
    for_people(app)
