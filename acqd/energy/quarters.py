"""Keeps the table `energy_quarter`: energy and cost of every quarter hour, for dashboards that know no tariff.

Quarter hours of the last two hours are computed again, and those of the last two days once a day, for rows that come
late. An earlier quarter hour keeps its cost when the tariff changes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.energy.account import Period
from acqd.energy.read import devices, read_account
from acqd.energy.rules import Rules
from acqd.energy.tariff import Tariff
from acqd.errors import InputError, UserError
from acqd.storage.database import transaction
from acqd.storage.schema import ROLLUPS, energy_quarter

_QUARTER_S = 900
_DAY_S = 86_400
_LATE_S = 2 * 3600
_LATE_DAYS_S = 2 * _DAY_S
_AT_ONCE_S = 7 * _DAY_S
"""Of a device in one call: a year that is made up for takes an hour of calls, and does not hold the sink up."""
_FURTHEST_S = 400 * _DAY_S


class Quarters:
    """Called again and again; does something when a quarter hour is complete."""

    def __init__(self, rules: Rules, clock: Callable[[], float] = time.time) -> None:
        """`rules` has a tariff."""
        assert rules.tariff is not None
        self._tariff, self._clock = rules.tariff, clock
        self._done: dict[str, int] = {}
        """Unix s up to which a device is done."""
        self._thorough: dict[str, float] = {}
        """When a device was read two days back."""

    def update(self, engine: sa.Engine) -> int:
        """Store what is missing; how many quarter hours. Raises the errors of SQLAlchemy."""
        now = self._clock()
        end = int(now) // _QUARTER_S * _QUARTER_S
        stored = 0
        for device in devices(engine):
            if self._done.get(device, 0) < end:
                stored += self._device(engine, device, end, now)
        return stored

    def _device(self, engine: sa.Engine, device: str, end: int, now: float) -> int:
        done = self._done.get(device)
        with engine.connect() as connection:
            of_device = energy_quarter.c.device == device
            newest = connection.execute(sa.select(sa.func.max(energy_quarter.c.start)).where(of_device)).scalar()
            begin = _first(connection, device) or end - _DAY_S
        if newest is not None and now - self._thorough.get(device, 0.0) >= _DAY_S:
            self._thorough[device] = now
            begin = int(newest) - _LATE_DAYS_S
        elif newest is not None or done is not None:
            begin = (done or int(newest or 0)) - _LATE_S
        begin = max(begin // _QUARTER_S * _QUARTER_S, end - _FURTHEST_S)
        until = min(begin + _AT_ONCE_S, end)
        self._done[device] = until
        rows = [_row(device, one, self._tariff) for one in self._periods(engine, device, begin, until)]
        if rows:
            with transaction(engine) as connection:
                insert: Any = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
                statement = insert(energy_quarter)
                changed = {name: statement.excluded[name] for name in ("kWh", "EUR", "missing_s", "tariff")}
                connection.execute(
                    statement.on_conflict_do_update(index_elements=["device", "start"], set_=changed), rows
                )
        return len(rows)

    def _periods(self, engine: sa.Engine, device: str, begin: int, until: int) -> list[Period]:
        """Quarter hours with a reading."""
        cuts = list(range(begin, until + 1, _QUARTER_S))
        try:
            account = read_account(engine, device, cuts, self._tariff)
        except InputError:  # no price for some of the time: energy without a cost
            account = read_account(engine, device, cuts, None)
        except UserError:  # no rows
            return []
        return [one for one in account.periods if one.nWh is not None]


def _first(connection: sa.Connection, device: str) -> int | None:
    """Start of the first roll-up."""
    starts = [
        connection.execute(sa.select(sa.func.min(table.c.start)).where(table.c.device == device)).scalar()
        for table in ROLLUPS.values()
    ]
    return min((int(start) for start in starts if start is not None), default=None)


def _row(device: str, one: Period, tariff: Tariff) -> dict[str, Any]:
    cost = None if one.cost is None or one.unpriced_nWh else float(one.cost)
    return {
        "device": device, "start": one.begin, "kWh": one.kWh, "EUR": cost, "missing_s": round(one.missing_s, 3),
        "tariff": tariff.name,
    }  # fmt: skip
