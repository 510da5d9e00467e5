"""Energy of today, yesterday and this week for the page, in local time."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from acqd.energy.account import Period
from acqd.energy.periods import Range, days_before, this_range, zone_of
from acqd.energy.read import read_account
from acqd.energy.tariff import Tariff, load_tariff
from acqd.errors import UserError

_KEPT_S = 60.0
"""An answer is good for so long; all viewers share it."""

_MOST_KEPT = 1_000
"""Devices; strangers may ask for any name."""


class EnergyOfDays:
    """Reads the registers of a device at midnights; with a tariff also what they cost."""

    def __init__(self, tariff: Path | None) -> None:
        """Raises UserError for a tariff that cannot be read."""
        self._tariff: Tariff | None = None if tariff is None else load_tariff(tariff)
        self._zone = (self._tariff.zone if self._tariff else None) or zone_of(None)
        self._kept: dict[str, tuple[float, dict[str, Any]]] = {}
        self._reading = threading.Lock()  # one at a time: the page must not take the database from the sink

    def of(self, engine: sa.Engine, device: str) -> dict[str, Any]:
        """Energies [kWh] and costs [EUR] by period; None where no row is known."""
        with self._reading:
            at, answer = self._kept.get(device, (0.0, {}))
            if time.monotonic() - at > _KEPT_S or not answer:
                answer = {"zone": self._zone.key, "device": device, **self._read(engine, device, time.time())}
                if len(self._kept) > _MOST_KEPT:
                    self._kept.clear()
                self._kept[device] = time.monotonic(), answer
            return answer

    def _read(self, engine: sa.Engine, device: str, now: float) -> dict[str, Any]:
        end = int(now) // 60 * 60
        midnight, before = (days_before(end, days, self._zone) for days in (0, 1))
        monday = this_range("week", now, self._zone)[0].begin
        spans = {"today": Range(midnight, end), "yesterday": Range(before, midnight), "week": Range(monday, end)}
        cuts = sorted({before, monday, midnight, end})
        try:
            periods = read_account(engine, device, cuts, self._tariff).periods if len(cuts) > 1 else []
        except UserError:  # no rows since then
            periods = []
        return {name: _sum([one for one in periods if _within(one, span)]) for name, span in spans.items()}


def _within(period: Period, span: Range) -> bool:
    return span.begin <= period.begin and period.end <= span.end


def _sum(periods: list[Period]) -> dict[str, float | None]:
    known = [one for one in periods if one.nWh is not None]
    if not known:
        return {"kWh": None, "EUR": None, "missing_s": None}
    costs = [one.cost for one in known]
    return {
        "kWh": sum(one.kWh or 0.0 for one in known),
        "EUR": None if None in costs else float(sum(cost for cost in costs if cost is not None)),
        "missing_s": sum(one.missing_s for one in periods),
    }
