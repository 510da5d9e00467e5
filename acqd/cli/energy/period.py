"""`acqd energy`: what a period cost, from the registers in SQL."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.atomic import write_table
from acqd.cli.energy.outputs import check_outputs
from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, configured
from acqd.cli.terminal import terminal
from acqd.errors import UserError

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

    from acqd.energy.periods import Range
    from acqd.energy.statement import Statement

_DEFAULT_DAYS = 7


def energy(
    context: typer.Context,
    device: Annotated[list[str] | None, typer.Option(help="Device; may be repeated (default: all).")] = None,
    begin: Annotated[
        str | None, typer.Option("--from", help="Start in local time: 2026-11-16, 2026-11-16T06:00 (default: 7 days).")
    ] = None,
    to: Annotated[str | None, typer.Option(help="End in local time, not included (default: now).")] = None,
    last: Annotated[str | None, typer.Option(help="Last complete day, week, month or year.")] = None,
    this: Annotated[str | None, typer.Option(help="Running day, week, month or year.")] = None,
    by: Annotated[
        str, typer.Option(help="hour, day, week, month, shift, total; with --marks: part, program, step, state.")
    ] = "day",
    tariff: Annotated[
        Path | None, typer.Option(help="TOML file with prices (docs/energy.md; default: the configuration's).")
    ] = None,
    zone: Annotated[
        str | None, typer.Option(help="Zone of local time (default: the tariff's, this computer's).")
    ] = None,
    shifts: Annotated[str | None, typer.Option(help="Starts of the shifts: 06:00,14:00,22:00.")] = None,
    marks: Annotated[
        Path | None, typer.Option(help="CSV file: from which time on which part, program, step or state (--by part).")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file, exact to the last digit.")] = None,
    html: Annotated[Path | None, typer.Option(help="HTML report with pictures.")] = None,
    config: ConfigFile = None,
    database: Annotated[str | None, typer.Option(help="SQLite file or URL (default: the configuration's).")] = None,
    json: Json = False,
) -> None:
    """Energy, cost and CO2 of a period, split by local time; gaps are shown and never filled.

    Example: acqd energy --database acqd.sqlite --last week --by day --tariff tariff.toml --html week.html
    """
    if context.invoked_subcommand is not None:
        if by != "day" or any(
            (device, begin, to, last, this, tariff, zone, shifts, marks, csv, html, config, database, json)
        ):
            raise UserError(f"put the options after the subcommand: acqd energy {context.invoked_subcommand} ...")
        return
    check_outputs("acqd energy", csv, html)
    where, rules, written = _source(config, database, tariff, zone)
    if marks is None and by in _MARKED:
        marks = written
    if marks is not None:
        from acqd.cli.energy.marked import marked

        marked(where, device or (), by, marks, (begin, to, last, this), rules, csv, html, json=json)
        return
    bill = _statement(where, device or (), (begin, to, last, this), by, (*rules, shifts))
    if csv is not None:
        from acqd.energy.tables import as_csv

        write_table(csv, as_csv(bill))
    if html is not None:
        from acqd.energy.page import energy_page

        energy_page(bill).write(html)
    if json:
        from acqd.energy.tables import as_json

        print(orjson.dumps({**as_json(bill), "csv": csv and str(csv), "html": html and str(html)}).decode())
        return
    _print(bill)
    for written in (csv, html):
        if written is not None:
            print(f"written: {written}")


_MARKED = ("program", "step", "part", "state")


def _source(
    config: Path | None, database: str | None, tariff: Path | None, zone: str | None
) -> tuple[str, tuple[Path | None, str | None], Path | None]:
    """The database, tariff and zone, and the file of marks: those of the configuration, unless a database is named."""
    if database is not None and config is None:
        return database, (tariff, zone), None
    from acqd.integrations.marks.section import MarksSection

    settings = configured(config)
    rules = (tariff or settings.energy.tariff, zone or settings.energy.zone)
    return database or settings.sink.database, rules, settings.table(MarksSection).file


def _statement(
    database: str,
    devices: Sequence[str],
    span: tuple[str | None, str | None, str | None, str | None],
    by: str,
    rules: tuple[Path | None, str | None, str | None],
) -> Statement:
    from acqd.energy.periods import SPLITS, parse_shifts, zone_of
    from acqd.energy.statement import statement_of
    from acqd.energy.tariff import load_tariff
    from acqd.storage.database import read_database

    split = next((each for each in SPLITS if each == by), None)
    if by in ("cycle", *_MARKED):
        raise UserError(
            f"--by {by} needs marks: --marks FILE.csv, or [marks] file of acqd bridge marks (docs/energy.md); "
            "of a robot's logs: acqd energy work DS"
        )
    if split is None:
        raise UserError(f"--by {by!r}: expected {', '.join(SPLITS)}")
    path, zone, shifts = rules
    given = None if path is None else load_tariff(path, zone)
    local = zone_of(zone) if zone or given is None or given.zone is None else given.zone
    starts = parse_shifts(shifts) if shifts else () if given is None else given.shifts
    chosen, earlier = ranges(*span, local)
    return statement_of(read_database(database), devices, chosen, earlier, split, local, starts, given)


def ranges(
    begin: str | None, to: str | None, last: str | None, this: str | None, zone: ZoneInfo
) -> tuple[Range, Range]:
    """The range that is asked for, and the one before."""
    from acqd.energy import periods

    if sum((begin is not None or to is not None, last is not None, this is not None)) > 1:
        raise UserError("--from and --to, --last, and --this exclude one another; give one")
    now = time.time()
    if last is not None:
        return periods.last_range(last, now, zone)
    if this is not None:
        return periods.this_range(this, now, zone)
    end = int(now) // 900 * 900 if to is None else periods.parse_moment("--to", to, zone)
    start = (
        periods.days_before(end, _DEFAULT_DAYS, zone) if begin is None else periods.parse_moment("--from", begin, zone)
    )
    chosen = periods.Range(start, end)
    return chosen, periods.before(chosen, zone)


def _print(bill: Statement) -> None:
    from acqd.energy.page import HEADER, cells, comparison_text

    console = terminal(tables=True)
    for account in bill.accounts:
        title = f"{account.device} {account.channel}, local time of {bill.zone.key}"
        table = Table(*HEADER, title=title, title_justify="left")
        for column in table.columns[1:]:
            column.justify = "right"
        for period in account.periods:
            table.add_row(*cells(bill, period))
        if len(account.periods) > 1:
            table.add_section()
            table.add_row("all", *cells(bill, account.total)[1:])
        console.print(table)
        if account.between_nWh:
            kwh = account.between_nWh / 1e12
            console.print(f"{kwh:.6f} kWh were counted where rows lack, over the end of a period: they belong to none")
        for remark in account.remarks:
            console.print(f"note: {remark}")
    who = bill.accounts[0].device if len(bill.accounts) == 1 else "all devices"
    console.print(f"{who}: {bill.total.kWh or 0.0:.3f} kWh; {comparison_text(bill)}")
    if bill.capacity_EUR is not None:
        console.print(f"capacity price: {bill.capacity_EUR:.2f} EUR {bill.capacity_text}")
