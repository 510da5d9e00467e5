"""Energy of today, yesterday and this week as it goes on: for the page and Home Assistant, every minute."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import sqlalchemy as sa

from acqd.changes import StateLog
from acqd.energy.account import Account, Period
from acqd.energy.comparison import Comparison, compare
from acqd.energy.periods import Range, days_before, this_range
from acqd.energy.read import read_accounts
from acqd.energy.rules import Rules
from acqd.energy.tariff import Tariff
from acqd.errors import InputError, UserError
from acqd.storage.buckets import Kept

_MINUTE_S = 60
_KEPT_S = 3600.0
"""After an hour everything is read again: rows of a backlog may have come into full minutes."""


@dataclass(frozen=True, slots=True)
class Price:
    """EUR per kWh now."""

    import_EUR: float
    export_EUR: float
    """Received."""


@dataclass(frozen=True, slots=True)
class Running:
    """What is known of a device now."""

    device: str
    zone: ZoneInfo
    today: Period | None
    """None: no rows."""
    yesterday: Period | None
    week: Period | None
    """From Monday."""
    last_week: Period | None
    """As far as this week has come."""
    price: Price | None
    """None without a tariff, or where it has no price now."""
    simulated: bool = False
    trouble: str = ""
    """Why there are no costs although there is a tariff."""

    @property
    def against_last_week(self) -> Comparison | str:
        """This week beside as much of the last one."""
        if self.week is None or self.last_week is None:
            return "no rows of last week" if self.week is not None else "no rows of this week"
        return compare(self.week, self.last_week)

    @property
    def standby_share(self) -> float | None:
        """Share of this week's energy at rest; None: unknown."""
        week = self.week
        return None if week is None or week.standby_nWh is None or not week.nWh else week.standby_nWh / week.nWh

    def as_json(self) -> dict[str, Any]:
        """For the page and for MQTT."""
        against = self.against_last_week
        known = against if isinstance(against, Comparison) else None
        return {
            "device": self.device,
            "zone": self.zone.key,
            **{name: energy_json(getattr(self, name)) for name in ("today", "yesterday", "week", "last_week")},
            "against_last_week": None if known is None else {"quantity": known.quantity, "change": known.change},
            "standby_share": self.standby_share,
            "price": None if self.price is None else self.price.import_EUR,
            "feed_in": None if self.price is None else self.price.export_EUR,
            "trouble": self.trouble,
        }  # fmt: skip


def energy_json(period: Period | None) -> dict[str, float | None]:
    """Energy, cost and what rows lack of a period; None for what is unknown."""
    if period is None or period.nWh is None:
        return {"kWh": None, "EUR": None, "unpriced_kWh": None, "missing_s": None}
    cost = None if period.cost is None else float(period.cost)
    return {
        "kWh": period.kWh, "EUR": cost, "unpriced_kWh": period.unpriced_nWh / 1e12, "missing_s": period.missing_s,
    }  # fmt: skip


class RunningEnergy:
    """Reads devices again and again; full minutes are read once an hour."""

    def __init__(self, rules: Rules, clock: Callable[[], float] = time.time) -> None:
        self.rules = rules
        self._clock = clock
        self._kept: dict[str, Kept] = {}
        self._since = 0.0
        self._log = StateLog(logging.getLogger(__name__))

    def of(self, engine: sa.Engine, device: str) -> Running:
        """Periods of local time up to the last full minute. Raises the errors of SQLAlchemy."""
        now = self._clock()
        if abs(now - self._since) > _KEPT_S:
            self._since = now
            self._kept.clear()
        kept = self._kept.setdefault(device, Kept())
        price, trouble = self._price(now)
        accounts = _accounts(engine, device, self._spans(now), self.rules.tariff, kept)
        # Last week is only compared, in kWh: a price that is missing there is no trouble.
        trouble = next((one.trouble for one in accounts[:3] if one is not None and one.trouble), trouble)
        if trouble:
            self._log.trouble("tariff", trouble, f"{trouble}; energies of that time have no cost")
        else:
            self._log.fine("tariff", "has prices again")
        today, yesterday, week, last = (None if account is None else account.total for account in accounts)
        simulated = any(each is not None and each.simulated for each in accounts)
        return Running(device, self.rules.zone, today, yesterday, week, last, price, simulated, trouble)

    def _spans(self, now: float) -> list[Range]:
        """Today, yesterday, this week, and as much of the last one."""
        zone, end = self.rules.zone, int(now) // 60 * 60
        midnight, before = (days_before(end, days, zone) for days in (0, 1))
        week, last = this_range("week", now, zone)
        as_far = days_before(end, 7, zone) + (end - midnight)
        return [Range(midnight, end), Range(before, midnight), Range(week.begin, end), Range(last.begin, as_far)]

    def _price(self, now: float) -> tuple[Price | None, str]:
        tariff = self.rules.tariff
        if tariff is None:
            return None, ""
        try:
            prices = tariff.prices(np.array([int(now) // 60 * 60]))
        except InputError as error:
            return None, str(error)
        return None if prices is None else Price(float(prices[0]), float(tariff.feed_in)), ""


def _accounts(
    engine: sa.Engine, device: str, spans: list[Range], tariff: Tariff | None, kept: Kept
) -> list[Account | None]:
    some = [span for span in spans if span.end > span.begin]
    try:
        accounts = read_accounts(engine, device, [(span.begin, span.end) for span in some], tariff, kept, _MINUTE_S)
    except UserError:  # no rows since then
        return [None] * len(spans)
    by_span = dict(zip(some, accounts, strict=True))
    return [by_span.get(span) for span in spans]
