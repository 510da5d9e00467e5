"""`acqd sink`: rows from MQTT into SQL; roll-ups and retention."""

from __future__ import annotations

import contextlib
import gc
import logging
import signal
import sys
import time
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.cli import quarantine
from acqd.cli.completeness_table import show_completeness
from acqd.cli.options import ConfigFile, Host, Json, Port, configured
from acqd.cli.progress import Show, progress
from acqd.cli.terminal import terminal
from acqd.cli.usage import NamingGroup
from acqd.daemon.config import Config
from acqd.daemon.config_place import SERVICES_STATE
from acqd.daemon.disk_check import disk_check
from acqd.daemon.health.sink import SinkHealth
from acqd.daemon.notify import notify
from acqd.errors import OperationError, UserError
from acqd.plc.kernel_clock import kernel_synchronised
from acqd.plc.realtime import die_with_parent

if TYPE_CHECKING:
    from collections.abc import Callable
    from datetime import date
    from pathlib import Path

    import sqlalchemy as sa

    from acqd.storage.sink import Sink

_log = logging.getLogger(__name__)
app = typer.Typer(invoke_without_command=True)
app.add_typer(
    quarantine.app,
    name="quarantine",
    cls=NamingGroup,
    help="What is no row, or cannot be true: list, restore or drop it.",
)
Database = Annotated[str | None, typer.Option(help="SQLite file or URL (default acqd.sqlite, or the config's).")]


def _group(name: str | None) -> str | None:
    """Callback of --group: a part of a topic (MQTT 5, section 4.8.2)."""
    if name is not None and (set(name) & set("/+# ") or not name.isprintable()):
        raise typer.BadParameter("expected a name without blanks, / + and #")
    return name


@app.callback()
def sink(
    context: typer.Context,
    config: ConfigFile = None,
    database: Database = None,
    host: Host = None,
    port: Port = None,
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    group: Annotated[
        str | None, typer.Option(callback=_group, help="Share the rows with the other sinks of this group.")
    ] = None,
    embedded: Annotated[int | None, typer.Option("--embedded", hidden=True, help="Process id of its daemon.")] = None,
    json: Json = False,
) -> None:
    """Write rows from the broker into SQL, acknowledging them after the commit.

    Example: acqd sink --database postgresql://acqd@localhost/acqd
    """
    if context.invoked_subcommand is not None:
        if any((config, database, host, port, duration, json)):
            raise UserError(f"put the options after the subcommand: acqd sink {context.invoked_subcommand} ...")
        return
    # Here and below: SQLAlchemy is slow to import, and `acqd run` imports this module too.
    from acqd.storage.away import DatabaseAwayError
    from acqd.storage.clock_witness import ClockWitness
    from acqd.storage.database import engine_for, file_of, prepare
    from acqd.storage.database_witness import DatabaseWitness
    from acqd.storage.sink import Sink
    from acqd.storage.upkeep import Upkeep

    if embedded:
        die_with_parent(embedded)
    # `acqd run` hands its configuration over on stdin: other users can read arguments, and it holds passwords.
    settings = Config.model_validate_json(sys.stdin.read()) if embedded else configured(config, host, port, "sink")
    engine = engine_for(database or settings.sink.database, impatient=True)
    if engine.dialect.name == "sqlite" and file_of(engine) is None:
        raise UserError(
            "[sink] database: it would be in memory only, and daemons forget rows that are stored; name a file"
        )
    prepared = False
    with contextlib.suppress(DatabaseAwayError):  # the sink says so, and retries
        prepare(engine)
        prepared = True
    # The embedded broker knows no MQTT 5, so do not try it first.
    mqtt5 = not (embedded and settings.broker.embedded)
    options = replace(settings.sink.settings(), mqtt5=mqtt5)
    if group is not None:
        options = replace(options, group=group)
    worker = Sink(
        settings.mqtt.address(),
        engine,
        options,
        prepared=prepared,
        witness=ClockWitness(kernel_synchronised),
        memory=DatabaseWitness(settings.state_dir, options.client_id),
    )
    stopping = False

    def stop(*_: object) -> None:
        nonlocal stopping
        stopping = True

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)
    end = time.monotonic() + duration if duration else None
    if embedded:
        print("ready", flush=True)
    else:
        _say_room(settings, file_of(engine))
    upkeep = Upkeep(engine, settings.sink.retention(), _costs(settings), worker.refusals)
    health = SinkHealth(settings.health, worker, options.client_id, upkeep, settings.mqtt.certificates)
    health.start()
    upkeep.start()
    gc.freeze()  # what was imported stays: collections look through the objects of rows only
    notify("READY=1")
    worker.run(lambda: stopping or (end is not None and time.monotonic() > end), health.turned)
    notify("STOPPING=1")
    upkeep.stop()
    health.stop()
    if json or not embedded:
        _report(worker, json)


def _say_room(config: Config, database: Path | None) -> None:
    """For how many days the disk of an SQLite database has room."""
    if database is None:
        return
    found = disk_check(config, database)
    if found.state == "ok":
        _log.info("disk: %s", found.finding)
    else:
        _log.warning("disk: %s; %s", found.finding, found.advice)


def _costs(settings: Config) -> Callable[[sa.Engine], int]:
    """Keeps the costs of quarter hours, where there is a tariff. What is wrong with its file does not stop the sink."""
    if settings.energy.tariff is None:
        return lambda _: 0
    from acqd.energy.quarters import Quarters
    from acqd.energy.tariff import load_tariff

    return Quarters(partial(load_tariff, settings.energy.tariff, settings.energy.zone)).update


def _advance(show: Show, step: str, days: int, of: int, done: float) -> None:
    show(step, (days + done) / of)


def _report(worker: Sink, json: bool) -> None:
    """What the sink has done."""
    names = ("rows", "quarantined", "conflicts", "batches", "reconnects")
    counters = {name: max(0, getattr(worker.counters, name)) for name in names}
    if json:
        print(orjson.dumps(counters).decode())
    else:
        print(", ".join(f"{value} {name}" for name, value in counters.items()))


@app.command("maintain")
def maintain_command(
    config: ConfigFile = None,
    database: Database = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="This computer's clock is right: delete what is old by it.")
    ] = False,
    json: Json = False,
) -> None:
    """Make the 1 min and 15 min roll-ups, then delete what is past its retention (keep_days in the configuration).

    Without keep_days, rows stay for 30 days, or for as long as the disk of an SQLite database has room.

    Deletes nothing where this computer's clock may be wrong, unless you say --yes.

    Example: acqd sink maintain --config /etc/acqd/acqd.toml
    """
    from acqd.storage.database import open_database
    from acqd.storage.maintain import maintain
    from acqd.storage.retention_doubt import doubt, note_run
    from acqd.storage.room import fitted

    settings = configured(config)
    engine, now = open_database(database or settings.sink.database, create=False), time.time()
    retention = fitted(engine, settings.sink.retention(), now)
    if not yes and (why := doubt(engine, retention, now)):
        raise UserError(f"maintain: {why}; nothing was deleted: set the clock, or say --yes if it is right")
    done = maintain(engine, retention, now)
    note_run(engine, now)
    if json:
        print(orjson.dumps(asdict(done)).decode())
    else:
        print(
            f"{done.rollup_1min} one-minute and {done.rollup_15min} quarter-hour roll-ups written; "
            f"deleted {done.power_deleted} rows, {done.rollup_deleted} old roll-ups, "
            f"{done.quarantine_deleted} quarantined messages"
        )


@app.command("completeness")
def completeness_command(
    day: Annotated[str | None, typer.Option(help="YYYY-MM-DD, today or yesterday (UTC; default).")] = None,
    first: Annotated[str | None, typer.Option("--from", help="Several days: the first, as in --day.")] = None,
    to: Annotated[str | None, typer.Option("--to", help="Several days: after the last (default: today).")] = None,
    device: Annotated[str | None, typer.Option(help="This device only.")] = None,
    config: ConfigFile = None,
    database: Database = None,
    json: Json = False,
) -> None:
    """Report for one day, or several, which rows are stored, which are missing, and why; exit 1 when rows were lost.

    Rows in the spool of state_dir (default /var/lib/acqd) wait: run it on the daemon's computer.

    Example: acqd sink completeness --day yesterday --config /etc/acqd/acqd.toml
    """
    from acqd.storage.completeness import completeness, days_between
    from acqd.storage.database import open_database
    from acqd.storage.gaps import Cause
    from acqd.storage.waiting import rows_in_spools, rows_of, with_waiting

    settings = configured(config)
    now = datetime.now(UTC)
    wanted = days_between(day, first, to, now)
    engine = open_database(database or settings.sink.database, create=False)
    with progress(terminal(stderr=True)) as show:
        report = []
        for k, one_day in enumerate(wanted):
            step = partial(_advance, show, f"rows of {one_day}", k, len(wanted))
            report += completeness(engine, one_day, now, device, step)
    spools = settings.state_dir or SERVICES_STATE
    if not report or any(gap.cause in (Cause.lost, Cause.no_rows) for one in report for gap in one.gaps):
        try:
            waiting = rows_in_spools(spools) if spools.is_dir() else {}
        except OperationError as error:
            terminal(stderr=True).print(f"note: {error}")
            waiting = {}
        report = with_waiting(report, waiting)
        if not report:
            raise _nothing(engine, wanted[-1], device, rows_of(waiting, device), spools)
    if json:
        print(orjson.dumps([asdict(one) | {"missing": one.missing} for one in report]).decode())
    else:
        for one_day in wanted:
            show_completeness([one for one in report if one.day == one_day.isoformat()], one_day.isoformat())
    if any(gap.cause == Cause.lost for one in report for gap in one.gaps):
        raise typer.Exit(1)


def _nothing(engine: sa.Engine, day: date, device: str | None, waiting: int, spools: Path) -> Exception:
    """Why there is no report of `day`."""
    from acqd.storage.completeness import first_day

    if device is not None and not waiting:
        return UserError(f"--device {device!r}: the database has no rows of this device on {day} or before")
    if device is None and (began := first_day(engine)) is not None:
        return OperationError(f"no row of {day} or before is stored: the first day with rows is {began}")
    if waiting:
        return OperationError(f"no row is stored yet, {waiting} rows wait in {spools}: is a sink running? acqd status")
    return OperationError(f"the database has no rows and no roll-ups until {day}: is it the right one?")
