"""Real processes, real faults: kills, hangs, cuts, locks; every row taped where it is made and looked for in SQL.

    python -m tools.studies.faults [--short] [--faults 60] [--seed 1] [--bed mosquitto+sqlite] [--plain] [--json]
    python -m tools.studies.faults --named [--only "device renamed"] [--json]

The daemon has the simulated source. Daemon, sink and sidecar reach the broker through a TCP proxy that cuts, delays and
resets. All have the memory limits of their units. Disks are filled where this is root with a loop device, the daemon's
clock is set where libfaketime is installed; a line says what is left out.
A fault is over when its cause is gone (the process runs again, the network passes); recovery is the time from then
until a row that was made afterwards is in the database. A sidecar has to do every log exactly once. Exit 1 when rows
were lost, still wait in the spool at the end (a slow computer), were duplicated, wrong, out of order or missing without
a flag, when logs were not done once, or when a process ended by itself. The tape is written before the spool: what a
killed daemon had on the tape alone, its last rows, is counted apart ("unspooled"), for it was never on a disk of acqd.
Needs mosquitto and PostgreSQL.
"""

from __future__ import annotations

import json as json_
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from acqd.cli.main import for_people
from acqd.errors import UserError
from tools.common.ending import end_in_order
from tools.common.tables import show
from tools.studies.faults import clock, disk, on_postgres, refusals
from tools.studies.faults.bed import BROKERS, DATABASES, Extras, Kind
from tools.studies.faults.campaign import Outcome, Plan, forget, run
from tools.studies.faults.faults import ALL
from tools.studies.faults.memory import how
from tools.studies.faults.named import CASES, measure

_BEDS = [Kind(broker, database) for broker in BROKERS for database in DATABASES]
_SHORT = [Kind("mosquitto", "sqlite")]
_NEVER = (
    "lost", "waiting", "duplicated", "wrong", "unflagged", "backwards", "energy back", "not recovered", "died",
    "logs wrong",
)  # fmt: skip


def faults(
    short: Annotated[bool, typer.Option("--short", help="One bed and 10 faults: about a minute.")] = False,
    count: Annotated[
        int | None, typer.Option("--faults", min=1, help="Faults per bed (default 60; short: 10).")
    ] = None,
    bed: Annotated[list[str] | None, typer.Option(help=f"Beds: {', '.join(map(str, _BEDS))}.")] = None,
    only: Annotated[list[str] | None, typer.Option(help=f"Faults: {', '.join(ALL)}.")] = None,
    plain: Annotated[bool, typer.Option("--plain", help="No faked clock, no full disks, no sidecar.")] = False,
    seed: Annotated[int, typer.Option(help="Order, moments and durations of the faults.")] = 1,
    named: Annotated[
        bool, typer.Option("--named", help="How long until the status names each fault; --only: parts of names.")
    ] = False,
    keep: Annotated[Path | None, typer.Option(help="Keep tapes, logs and databases in this new folder.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Disturb the running chain and count what became of its rows.

    Example: python -m tools.studies.faults --short --seed 7
    """
    end_in_order()
    if named:
        raise SystemExit(_name(only or [], keep, json=json))
    kinds = kinds_of(bed) if bed else _SHORT if short else _BEDS
    count = count or (10 if short else 60)
    unknown = set(only or []) - set(ALL)
    if unknown:
        raise UserError(f"--only {sorted(unknown)[0]!r}: expected one of {', '.join(ALL)}")
    if keep is not None and keep.exists():
        raise UserError(f"--keep {keep} exists; name a new folder")
    console = Console(stderr=True)
    plan = Plan(seed, count, frozenset(only or []), Extras() if plain or short else _extras(console))
    place = keep or Path(tempfile.mkdtemp(prefix="acqd-faults-"))
    console.print(f"memory limits of the units: {how()}", highlight=False)
    outcomes: list[Outcome] = []
    with Progress(console=console, disable=not console.is_terminal) as progress:
        for kind in kinds:
            bar = progress.add_task(str(kind), total=count)
            begun = time.monotonic()

            def tick(name: str, bar: Any = bar, begun: float = begun, kind: Kind = kind) -> None:
                progress.update(bar, advance=1)
                if not console.is_terminal:
                    console.print(f"{time.monotonic() - begun:7.1f} s  {kind}: {name}", highlight=False)

            outcomes.append(run(kind, place / str(kind), plan, tick))
            if keep is None:
                forget(place / str(kind))
    if keep is None:
        forget(place)
    if json:
        print(json_.dumps([outcome.figures() | {"detail": asdict(outcome)} for outcome in outcomes]))
    else:
        show(_beds(outcomes), _kinds_of_fault(outcomes), width=150)
    raise SystemExit(0 if all(map(_good, outcomes)) else 1)


def _name(parts: list[str], keep: Path | None, *, json: bool) -> int:
    """Measure in how many seconds the status names each fault; 1 where one is not named in time."""
    console = Console(stderr=True)
    able = _extras(console)
    wanted = [case for case in CASES if not parts or any(part in case.fault for part in parts)]
    possible = [case for case in wanted if not case.need or getattr(able, case.need)]
    if not possible:
        raise UserError(f"--only: expected parts of {', '.join(case.fault for case in CASES)}")
    place = keep or Path(tempfile.mkdtemp(prefix="acqd-named-"))
    done = []
    for k, case in enumerate(possible):
        done.append(measure(case, place / str(k)))
        console.print(f"{case.fault}: {done[-1].seconds} s", highlight=False)
        if keep is None:
            forget(place / str(k))
    if keep is None:
        forget(place)
    if json:
        print(json_.dumps([asdict(one) | {"good": one.good} for one in done]))
    else:
        table = Table("fault", "named after s", "", "sentence")
        for one in done:
            seconds = "-" if one.seconds is None else f"{one.seconds:.1f}"
            table.add_row(one.fault, seconds, "PASS" if one.good else "FAIL", one.sentence)
        show(table, width=200)
    return 0 if all(one.good for one in done) else 1


def _extras(console: Console) -> Extras:
    """What this computer can do; one line about what it cannot."""
    reasons = {
        "clock set": clock.missing(), "disk full": disk.missing(), "disk errors": refusals.missing(),
        "pooler": on_postgres.missing_pooler(),
    }  # fmt: skip
    for name, reason in reasons.items():
        if reason:
            console.print(f"skipped: {name} ({reason})", highlight=False)
    return Extras(
        clock=not reasons["clock set"],
        disks=not reasons["disk full"],
        refusals=not reasons["disk errors"],
        pooler=not reasons["pooler"],
        sidecar=True,
    )


def kinds_of(names: list[str]) -> list[Kind]:
    """Beds by their names. Raises UserError."""
    known = {str(kind): kind for kind in _BEDS}
    for name in names:
        if name not in known:
            raise UserError(f"--bed {name!r}: expected one of {', '.join(known)}")
    return [known[name] for name in names]


def _good(outcome: Outcome) -> bool:
    """No row lost, duplicated, wrong or out of order, every hole flagged; rows unspooled by kills only."""
    figures = outcome.figures()
    return figures["cut short"] <= figures["daemon kills"] and not any(figures[name] for name in _NEVER)


def _beds(outcomes: list[Outcome]) -> Table:
    figures = [outcome.figures() for outcome in outcomes]
    table = Table("", *(str(column["bed"]) for column in figures))
    for name in list(figures[0])[1:]:
        table.add_row(name, *("-" if column[name] is None else str(column[name]) for column in figures))
    return table


def _kinds_of_fault(outcomes: list[Outcome]) -> Table:
    table = Table("fault", "times", "not recovered", "mean recovery s", "worst recovery s")
    for name in ALL:
        hits = [hit for outcome in outcomes for hit in outcome.hits if hit.fault == name]
        times = [hit.recovery_s for hit in hits if hit.recovery_s is not None]
        if hits:
            mean, worst = (f"{sum(times) / len(times):.2f}", f"{max(times):.2f}") if times else ("-", "-")
            table.add_row(name, str(len(hits)), str(len(hits) - len(times)), mean, worst)
    return table


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(faults)
    for_people(app)
