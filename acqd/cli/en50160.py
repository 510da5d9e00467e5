"""`acqd en50160`: the week of a supply voltage, from stored rows of power quality."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer
from rich.text import Text

from acqd.atomic import require_page
from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, configured
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import require

if TYPE_CHECKING:
    import sqlalchemy as sa

    from acqd.en50160.statistics import EventClass, Statistic


_LONGEST = timedelta(days=366)


def en50160(
    declared_voltage: Annotated[float, typer.Option(min=1, max=1e6, help="Un in V: 100 % of the limits.")],
    device: Annotated[str | None, typer.Option(help="Device; needed where the database has several.")] = None,
    begin: Annotated[
        str | None, typer.Option("--from", help="Start, UTC (default: seven days before the end).")
    ] = None,
    to: Annotated[str | None, typer.Option(help="End, UTC, not included (default: --days after the start).")] = None,
    days: Annotated[
        float | None, typer.Option(min=0.01, max=366, help="Length of the period without --from and --to (default 7).")
    ] = None,
    f_nominal: Annotated[float, typer.Option(help="50 or 60 Hz.")] = 50.0,
    out: Annotated[Path | None, typer.Option(help="HTML report with pictures.")] = None,
    config: ConfigFile = None,
    database: Annotated[str | None, typer.Option(help="SQLite file or URL (default: the configuration's).")] = None,
    json: Json = False,
) -> None:
    """Compare a week of stored power quality with EN 50160; exit 1 where a requirement is not met.

    Example: acqd en50160 --database acqd.sqlite --declared-voltage 230 --from 2026-11-16 --out week.html
    """
    if f_nominal not in (50.0, 60.0):
        raise UserError(f"--f-nominal {f_nominal:g}: expected 50 or 60")
    start, end = _span(begin, to, days)
    if out is not None:
        require_page(out)
        require("acqd en50160 --out", ("jinja2",), "lab")
    from acqd.en50160.read import read_period
    from acqd.en50160.statistics import as_json, event_classes, statistics_of
    from acqd.storage.database import read_database

    engine = read_database(database or configured(config).sink.database)
    period = read_period(engine, _device(engine, device), start, end)
    statistics, events = statistics_of(period, declared_voltage, f_nominal), event_classes(period)
    if out is not None:
        from acqd.en50160.page import week_page

        week_page(period, statistics, events, declared_voltage).write(out)
    if json:
        told = {
            "device": period.device, "from": period.begin.isoformat(), "to": period.end.isoformat(),
            "simulated": period.simulated, "statistics": [as_json(one) for one in statistics],
            "events": [{"kind": one.kind, "voltage": one.voltage, "counts": one.counts} for one in events],
            "met": all(one.met is not False for one in statistics), "report": None if out is None else str(out),
        }  # fmt: skip
        print(orjson.dumps(told).decode())
    else:
        _print(statistics, events)
        if out is not None:
            print(f"report: {out}")
    if any(one.met is False for one in statistics):
        raise typer.Exit(1)


def _span(begin: str | None, to: str | None, days: float | None) -> tuple[datetime, datetime]:
    """The period: between two times, or so many days after or before one of them, or before now. Raises UserError."""
    if begin is not None and to is not None and days is not None:
        raise UserError("--from, --to and --days: two of them make a period; leave one out")
    length = timedelta(days=7.0 if days is None else days)
    if begin is not None:
        start = _moment("--from", begin)
        end = start + length if to is None else _moment("--to", to)
    else:
        now = datetime.now(UTC)
        end = now.replace(minute=now.minute // 10 * 10, second=0, microsecond=0) if to is None else _moment("--to", to)
        start = end - length
    if not start < end <= start + _LONGEST:
        raise UserError(f"--to {to!r}: expected a time up to {_LONGEST.days} days after the start, {start.isoformat()}")
    return start, end


def _moment(option: str, text: str) -> datetime:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise UserError(f"{option} {text!r}: expected a time like 2026-11-16 or 2026-11-16T00:00:00Z") from None
    if not 1971 <= moment.year < 2200:
        raise UserError(f"{option} {text!r}: expected a time between 1971 and 2199")
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def _device(engine: sa.Engine, device: str | None) -> str:
    from acqd.en50160.read import devices

    known = devices(engine)
    if not known:
        raise UserError("the database has no 10 min values of power quality; [quality] enabled = true makes them")
    if device is None and len(known) > 1:
        raise UserError(f"the database has several devices; give --device: {', '.join(known)}")
    if device is not None and device not in known:
        raise UserError(f"--device {device!r}: no 10 min values; the database has those of {', '.join(known)}")
    return device or known[0]


def _print(statistics: list[Statistic], events: list[EventClass]) -> None:
    console = terminal(tables=True)
    table = Table("", "channel", "requirement", "within", "95 %", "values", "left out", "")
    for one in statistics:
        if one.characteristic == "harmonics" and one.met is not False:
            continue
        state = {True: Text("met", "green"), False: Text("NOT MET", "red"), None: Text("no values")}[one.met]
        within, p95 = ("-", "-") if not one.values else (f"{100 * one.within:.2f} %", f"{one.p95:.4g} {one.unit}")
        count = f"{one.values} of {one.expected}"
        table.add_row(one.characteristic, one.channel, one.requirement, within, p95, count, str(one.left_out), state)
    console.print(table)
    harmonics = [one for one in statistics if one.characteristic == "harmonics"]
    console.print(f"{sum(one.met is True for one in harmonics)} of {len(harmonics)} limits of single harmonics are met")
    console.print(f"{sum(sum(one.counts) for one in events)} dips, interruptions and swells (classes: --json, --out)")
