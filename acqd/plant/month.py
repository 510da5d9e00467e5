"""A month of the plant to print: energy, cost, the month before, peaks and gaps of every device."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote
from zoneinfo import ZoneInfo

import numpy as np
import sqlalchemy as sa

from acqd.energy.account import Account, Period, sum_of
from acqd.energy.comparison import Comparison, compare
from acqd.energy.page import euros, watts
from acqd.energy.periods import Range, boundaries, current, last_range, parse_moment, this_range
from acqd.energy.read import devices, has_rows, stored_span
from acqd.energy.rules import Rules
from acqd.energy.tables import standby_share
from acqd.energy.tariff import QUARTER_S
from acqd.errors import UserError
from acqd.fleet import words
from acqd.plant.plant import Progress, accounts_of
from acqd.report.blocks import Link
from acqd.report.digits import counted, duration, number, percent, signed_percent
from acqd.report.lines import Chart, Line, Panel
from acqd.report.page import Page
from acqd.report.verdict import KeyFigure, Tone, Verdict

_HEAD = ("device", "kWh", "EUR", "share", "month before", "15 min peak", "standby", "without rows")


@dataclass(frozen=True, slots=True)
class Month:
    """A month of all devices that have rows in it, or in the month before."""

    chosen: Range
    rules: Rules
    accounts: list[Account]
    """Of the whole month: what was counted over a gap at midnight belongs to the month, and to no day."""
    days: list[Account]
    """By day."""
    before: dict[str, Period]
    """The month before, by device."""
    changes: dict[str, Mapping[str, Any]]
    """What `acqd fleet` has found, of changes in this month."""
    trouble: str
    gone: list[str]
    """Devices with rows in the month before and none in this."""

    @property
    def name(self) -> str:
        """As 2026-10."""
        return month_name(self.chosen, self.rules.zone)

    @property
    def total(self) -> Period:
        """Of all devices."""
        return sum_of([account.total for account in self.accounts])

    @property
    def capacity_EUR(self) -> float | None:  # noqa: N802
        """The capacity price of the month, of every device by itself; None: no such price, or an unknown maximum."""
        tariff = self.rules.tariff
        demands = [account.total.demand for account in self.accounts]
        if tariff is None or tariff.capacity_price is None or tariff.capacity_per != "month":
            return None
        known = [demand.W for demand in demands if demand is not None]
        return float(tariff.capacity_price) * sum(known) / 1000 if len(known) == len(demands) else None


def month_name(month: Range, zone: ZoneInfo) -> str:
    """As 2026-10."""
    return f"{datetime.fromtimestamp(month.begin, zone):%Y-%m}"


def month_range(text: str | None, now: float, zone: ZoneInfo) -> tuple[Range, Range]:
    """A month like 2026-10, or the last complete one; and the one before, of a running month as much. Raises UserError.

    The running month ends with its last full quarter hour.
    """
    if text is None:
        return last_range("month", now, zone)
    if not re.fullmatch(r"\d{4}-(0[1-9]|1[0-2])", text):
        raise UserError(f"--month {text!r}: expected a month like 2026-10")
    chosen = current("month", parse_moment("--month", f"{text}-01", zone), zone)
    if chosen.begin > now:
        raise UserError(f"--month {text!r} has not begun yet")
    if chosen.end > now:
        return this_range("month", now, zone)
    return chosen, current("month", chosen.begin - 3600, zone)


def read_month(
    engine: sa.Engine, rules: Rules, chosen: Range, earlier: Range, found: Mapping[str, Mapping[str, Any]],
    progress: Progress,
) -> Month:  # fmt: skip
    """Raises UserError where no device has rows in the month."""
    cuts = boundaries(chosen, "day", rules.zone)
    accounts, days, before, trouble, gone = [], [], {}, "", []
    names = devices(engine)
    for k, name in enumerate(names):
        progress(f"{name}: energy", k / len(names))
        spans = [[chosen.begin, chosen.end], cuts, [earlier.begin, earlier.end]]
        found_of, why = accounts_of(engine, name, spans, rules)
        if not found_of:
            continue
        whole, by_day, last = found_of
        trouble = trouble or why
        if last.total.known_s > 0:
            before[name] = last.total
        if whole.total.known_s > 0:
            accounts.append(whole)
            days.append(by_day)
        elif name in before:
            gone.append(name)
    if not accounts:
        stored = _stored_months(engine, names, rules.zone)
        remedy = f"rows are stored in {stored}: choose one with --month" if stored else "`acqd sink` stores them"
        end = min(chosen.end + QUARTER_S, current("month", chosen.begin, rules.zone).end)
        if any(has_rows(engine, name, chosen.begin, end) for name in names):
            raise UserError(
                f"{month_name(chosen, rules.zone)} has rows of the running quarter hour only: they count "
                "when that is over"
            )
        raise UserError(f"no device has rows in {month_name(chosen, rules.zone)}; {remedy}")
    accounts.sort(key=lambda account: -(account.total.nWh or 0))
    changes = {name: row for name, row in found.items() if chosen.begin <= (row["since_s"] or 0) < chosen.end}
    return Month(chosen, rules, accounts, days, before, changes, trouble, gone)


def _stored_months(engine: sa.Engine, names: Sequence[str], zone: ZoneInfo) -> str:
    """Months in which a device has rows, as `2026-01, 2026-03 to 2026-05`."""
    spans = [span for name in names if (span := stored_span(engine, name))]
    runs: list[list[str]] = []
    month = current("month", min((first for first, _ in spans), default=0), zone)
    goes_on = False
    while spans and month.begin < max(end for _, end in spans):
        known = any(has_rows(engine, name, month.begin, month.end) for name in names)
        if known and goes_on:
            runs[-1][1:] = [month_name(month, zone)]
        elif known:
            runs.append([month_name(month, zone)])
        goes_on, month = known, current("month", month.end, zone)
    return ", ".join(" to ".join(run) for run in runs)


def month_page(month: Month, out: Path) -> Page:
    """The page, to be written to `out`."""
    page = Page(f"{month.name}: energy of the plant", simulated=any(one.simulated for one in month.accounts),
                kind="month")  # fmt: skip
    page.verdict(_verdict(month))
    page.heading("Days")
    page.lines(_days(month), "Energy of all devices by day; no bar where a device has no row of a day")
    page.heading("Devices")
    total = month.total.kWh
    length = duration(month.chosen.end - month.chosen.begin)
    gone = [[name, "-", "-", "-", "no rows since", "-", "-", length] for name in month.gone]
    page.table(_HEAD, [*(_cells(month, account, total) for account in month.accounts), *gone])
    over = sum(account.between_nWh for account in month.days) / 1e12
    page.text(
        f"Time without rows is shown and never filled; {number(over)} kWh were counted where rows lack, over the end "
        "of a day: they belong to the month, and to no day." if over else "Time without rows is shown and never filled."
    )  # fmt: skip
    page.heading("What has changed")
    rows = [
        [_linked(name, row, out), words.since(dict(row)), words.what(dict(row)), words.how_much(dict(row)),
         words.a_year(dict(row))]
        for name, row in sorted(month.changes.items())
    ]  # fmt: skip
    if rows:
        page.table(("device", "since (UTC)", "what", "how much", "a year"), rows)
    tariff = month.rules.tariff
    page.detail("tariff", tariff.name if tariff is not None else "none: energies have no cost")
    page.detail("zone", month.rules.zone.key)
    return page


def _verdict(month: Month) -> Verdict:
    total = month.total
    lacking = [account.device for account in month.accounts if account.total.missing_s >= 60]
    figures = [KeyFigure("energy", "-" if total.kWh is None else f"{number(total.kWh, 4)} kWh", _against(month))]
    if total.cost is not None:
        name = month.rules.tariff.name if month.rules.tariff is not None else ""
        figures.append(KeyFigure("cost", euros(total), name))
    if (capacity := month.capacity_EUR) is not None:
        figures.append(KeyFigure("capacity", f"{capacity:.2f} EUR", "for the highest quarter hour of each device"))
    share = standby_share(total)
    if share is not None:
        figures.append(KeyFigure("standby", percent(share), "of the energy"))
    figures.append(KeyFigure("devices", str(len(month.accounts))))
    missing = sum(account.total.missing_s for account in month.accounts)
    devices = f"{counted(len(lacking), 'device')} {'lacks' if len(lacking) == 1 else 'lack'}"
    sentences = [f"{devices} rows, for {duration(missing)} in sum."] if lacking else []
    if month.gone:
        sentences.append(f"No row in this month, but in the month before: {', '.join(month.gone)}.")
    sentence = " ".join(sentences) or "Rows of the whole month are there."
    tone: Tone = "open" if sentences else "fine"
    return Verdict(tone, figures[0].value, sentence, figures, [], [month.trouble] if month.trouble else [])


def _against(month: Month) -> str:
    """Against the month before, of the devices that have both: others would look like a change."""
    both = [account for account in month.accounts if account.device in month.before]
    if not both:
        return "no rows of the month before"
    now = sum_of([account.total for account in both])
    found = compare(now, sum_of([month.before[account.device] for account in both]))
    some = f", of {len(both)} of {counted(len(month.accounts), 'device')}" if len(both) < len(month.accounts) else ""
    return _change(found) + some


def _change(found: Comparison | str) -> str:
    if not isinstance(found, Comparison):
        return found
    if found.change is None:
        return "nothing the month before"
    why = "" if found.quantity == "kWh" else " (mean power: rows lack)"
    return f"{signed_percent(found.change)}{why}"


def _cells(month: Month, account: Account, total: float | None) -> list[str]:
    one = account.total
    share = one.kWh / total if one.kWh is not None and total else None
    standby = standby_share(one)
    before = month.before.get(account.device)
    return [
        account.device, "-" if one.kWh is None else f"{one.kWh:.3f}", euros(one).removesuffix(" EUR"),
        "-" if share is None else percent(share), "no rows" if before is None else _change(compare(one, before)),
        watts(one.demand.W if one.demand else None), "-" if standby is None else percent(standby),
        duration(one.missing_s) if one.missing_s >= 60 else "",
    ]  # fmt: skip


def _days(month: Month) -> Chart:
    days = [sum_of(together) for together in zip(*(account.periods for account in month.days), strict=True)]
    values = np.array([one.kWh if one.kWh is not None and one.known_s > 0 else np.nan for one in days])
    number_of_day = np.arange(1.0, len(days) + 1)
    alt = f"Energy of all devices on the {len(days)} days of {month.name}."
    return Chart(
        number_of_day, "day of the month", [Panel("energy [kWh]", [Line("energy", values, "after")], bars=True)], alt
    )


def _linked(name: str, row: Mapping[str, Any], out: Path) -> str | Link:
    if not row["report"] or not Path(row["report"]).exists():
        return name
    return Link(name, quote(os.path.relpath(Path(row["report"]).resolve(), out.resolve().parent)))
