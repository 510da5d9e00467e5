"""A budget of a day, a week or a month: what is used of it, and whether the rest of the period will exceed it.

The forecast adds to what is used what the same stretch of time took before: of a day or a week, the rest of it seven
days earlier; of a month, the mean of the last 28 days for every day that is left. Where that time has too few rows, the
rate of the period so far goes on. Early in a period without either, nothing is forecast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any, Literal
from zoneinfo import ZoneInfo

import sqlalchemy as sa

from acqd.energy.account import Account, Period, sum_of
from acqd.energy.budget_section import Budget
from acqd.energy.periods import Range, current, days_before
from acqd.energy.read import NoRowsError, devices, read_accounts
from acqd.energy.rules import Rules
from acqd.errors import UserError
from acqd.report.digits import duration, number, percent
from acqd.storage.buckets import Kept

_BASIS = 0.9
"""Least share of the earlier time with rows, for a forecast from it."""
_BEGUN = 0.1
"""Least share of the period that has passed, for a forecast from its own rate."""
_SAID_S = 600.0
"""Time without rows that is worth a word."""
_MONTH_BASIS_DAYS = 28
State = Literal["within", "forecast", "exceeded", "unknown"]


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a budget stands."""

    budget: Budget
    begin: int
    """Unix s of the period."""
    state: State
    used: float | None
    """In the budget's unit."""
    forecast: float | None
    text: str
    """One line for people."""

    def as_json(self) -> dict[str, Any]:
        """For programs."""
        budget = self.budget
        return {
            "device": budget.device, "per": budget.per, "unit": budget.unit, "limit": budget.limit, "begin": self.begin,
            "state": self.state, "used": self.used, "forecast": self.forecast, "text": self.text,
        }  # fmt: skip


class Budgets:
    """Looks at all budgets again and again."""

    def __init__(self, budgets: Sequence[Budget], rules: Rules) -> None:
        """Raises UserError for a budget in EUR without a price."""
        for budget in budgets:
            if budget.unit == "EUR" and (rules.tariff is None or rules.tariff.price is None):
                raise UserError(f"budgets: {budget.limit:g} EUR needs prices; set tariff in [energy], or give kWh")
        self._budgets, self._rules = budgets, rules
        self._reader = _Reader(rules)

    def standings(self, engine: sa.Engine, now: float) -> list[Standing]:
        """One per budget. Raises the errors of SQLAlchemy."""
        self._reader.forget_at(now)
        return [self._standing(engine, budget, now) for budget in self._budgets]

    def unknown(self, why: str, now: float) -> list[Standing]:
        """One per budget, where the database does not answer."""
        return [self._unknown(budget, why, now) for budget in self._budgets]

    def _unknown(self, budget: Budget, why: str, now: float) -> Standing:
        begin = current(budget.per, now, self._rules.zone).begin
        return Standing(budget, begin, "unknown", None, None, f"{_name(budget)} cannot be watched: {why}")

    def _standing(self, engine: sa.Engine, budget: Budget, now: float) -> Standing:
        zone = self._rules.zone
        whole = current(budget.per, now, zone)
        tariff = self._rules.tariff
        by_minute = budget.unit == "EUR" and tariff is not None and tariff.by_minute
        step = 60 if budget.per == "day" or by_minute else 900
        until = max(int(now) // step * step, whole.begin)
        rest = _earlier(budget, whole, until, zone)
        spans = [Range(whole.begin, until), rest]
        try:
            used, before = self._reader.periods(engine, budget, spans, step)
        except UserError as error:
            return self._unknown(budget, str(error), now)
        value = _of(budget, used)
        if value is None:
            return self._unknown(budget, f"nothing is known of this {budget.per} yet", now)
        forecast, basis = _forecast(budget, value, used, before, whole, until, rest, zone)
        state: State = (
            "exceeded" if value > budget.limit
            else "forecast" if forecast is not None and forecast > budget.limit else "within"
        )  # fmt: skip
        text = _text(budget, state, value, forecast, basis, used)
        return Standing(budget, whole.begin, state, value, forecast, text)


def _earlier(budget: Budget, whole: Range, until: int, zone: ZoneInfo) -> Range:
    """The time that says what the rest of the period will take."""
    if budget.per == "month":
        begin = days_before(until, _MONTH_BASIS_DAYS, zone)
        return Range(begin, days_before(until, 0, zone))
    # the same time of the clock, over its change, too
    earlier = [datetime.fromtimestamp(at, zone) - timedelta(days=7) for at in (until, whole.end)]
    return Range(*(round(moment.timestamp()) for moment in earlier))


def _forecast(
    budget: Budget, value: float, used: Period | None, before: Period | None, whole: Range, until: int, rest: Range,
    zone: ZoneInfo,
) -> tuple[float | None, str]:  # fmt: skip
    left = whole.end - until
    if not left:
        return value, "the period is over"
    earlier = _of(budget, before)
    if before is not None and earlier is not None and before.known_s >= _BASIS * (rest.end - rest.begin) > 0:
        if budget.per == "month":
            days = (rest.end - rest.begin) / 86_400
            return value + earlier / days * left / 86_400, "if the days that are left are like the last four weeks"
        day = datetime.fromtimestamp(rest.begin, zone)
        return value + earlier, f"if the rest is like that of the {budget.per} of {day:%a %Y-%m-%d}"
    passed = until - whole.begin
    if used is not None and passed >= _BEGUN * (whole.end - whole.begin) and used.known_s >= _BASIS * passed:
        return value * (whole.end - whole.begin) / passed, f"at the rate of this {budget.per} so far"
    return None, "too little is known for a forecast"


def _of(budget: Budget, period: Period | None) -> float | None:
    if period is None:
        return None
    if budget.unit == "kWh":
        return period.kWh
    return None if period.cost is None else float(period.cost)


def _name(budget: Budget) -> str:
    return f"{budget.device or 'all devices'}: the budget of {number(budget.limit)} {budget.unit} a {budget.per}"


def _text(budget: Budget, state: State, value: float, forecast: float | None, basis: str, used: Period | None) -> str:
    unit, share = budget.unit, percent(value / budget.limit)
    begun = f"{_name(budget)} is exceeded" if state == "exceeded" else f"{_name(budget)}: {share} is used"
    ahead = f"; {number(forecast)} {unit} by its end {basis}" if forecast is not None else f"; {basis}"
    lacking = used.missing_s if used is not None else 0.0
    gaps = f"; rows lack for {duration(lacking)}" if lacking > _SAID_S else ""
    without = used.unpriced_nWh / 1e12 if used is not None and unit == "EUR" else 0.0
    unpriced = f"; {number(without)} kWh have no price" if without else ""
    return f"{begun}, {number(value)} {unit}{ahead}{gaps}{unpriced}"


@dataclass
class _Reader:
    """Energies of a device, or of all together; full buckets are read once an hour."""

    rules: Rules
    kept: dict[tuple[str, int], Kept] = field(default_factory=dict)
    since: float = 0.0

    def forget_at(self, now: float) -> None:
        if abs(now - self.since) > timedelta(hours=1).total_seconds():
            self.since = now
            self.kept.clear()

    def periods(self, engine: sa.Engine, budget: Budget, spans: Sequence[Range], seconds: int) -> list[Period | None]:
        """The total of each span, or None; a span without prices for all of its time is None, too.

        Raises UserError where no device has rows, or the first span lacks a price.
        """
        device, tariff = budget.device, self.rules.tariff if budget.unit == "EUR" else None
        some = [span for span in spans if span.end > span.begin]
        found: list[list[Account]] = []
        trouble = "the database has no rows of power"
        for name in devices(engine) if device is None else [device]:
            kept = self.kept.setdefault((name, seconds), Kept())
            try:
                accounts = read_accounts(engine, name, [(span.begin, span.end) for span in some], tariff, kept, seconds)
            except UserError as error:  # of one that has been taken away, there are no rows
                trouble = error.what if isinstance(error, NoRowsError) else str(error)
                continue
            found.append(accounts)
        if not found:
            raise UserError(trouble)
        totals = {}
        for span, of_devices in zip(some, zip(*found, strict=True), strict=True):
            unpriced = next((account.trouble for account in of_devices if account.trouble), "")
            if unpriced and span == spans[0]:
                raise UserError(unpriced)
            totals[span] = None if unpriced else sum_of([account.total for account in of_devices])
        return [totals.get(span) for span in spans]
