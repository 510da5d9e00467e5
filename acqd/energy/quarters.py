"""Keeps the table `energy_quarter`: energy and cost of every quarter hour, for dashboards that know no tariff.

Quarter hours of the last two hours are computed again, and those of the last two days once a day, for rows that come
late, and whenever a price of these days was missing and has come. Earlier ones without a line get one once a day; a
line that is there keeps its cost when the tariff changes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.energy.account import Period
from acqd.energy.price_series import Series
from acqd.energy.read import devices, read_accounts
from acqd.energy.tariff import QUARTER_S, Tariff
from acqd.errors import UserError
from acqd.storage.database import transaction
from acqd.storage.schema import ROLLUPS, energy_quarter

_DAY_S = 86_400
_LATE_S = 2 * 3600
_LATE_DAYS_S = 2 * _DAY_S
_AT_ONCE_S = 7 * _DAY_S
"""Of a device in one call: a year that is made up for takes an hour of calls, and does not hold the sink up."""
_FURTHEST_S = 400 * _DAY_S


class Quarters:
    """Called again and again; does something when a quarter hour is complete."""

    def __init__(self, tariff: Callable[[], Tariff], clock: Callable[[], float] = time.time) -> None:
        """`tariff` reads it again, when a quarter hour is complete: files of prices grow. It may raise UserError."""
        self._tariff, self._clock = tariff, clock
        self._done: dict[str, int] = {}
        """Unix s up to which a device is done."""
        self._thorough: dict[str, float] = {}
        """When a device was read two days back."""
        self._lacking: dict[str, list[int]] = {}
        """Earlier quarter hours with rows and without a line."""
        self._without: dict[str, set[int]] = {}
        """Those that get none: their rows give no energy."""

    def update(self, engine: sa.Engine) -> int:
        """Store what is missing; how many quarter hours. Raises UserError, and the errors of SQLAlchemy."""
        now = self._clock()
        end = int(now) // QUARTER_S * QUARTER_S
        due = [name for name in devices(engine) if self._done.get(name, 0) < end or self._lacking.get(name)]
        if not due:
            return 0
        tariff = replace(self._tariff(), co2=None)  # no column for it
        return sum(self._device(engine, device, end, now, tariff) for device in due)

    def _device(self, engine: sa.Engine, device: str, end: int, now: float, tariff: Tariff) -> int:
        if self._lacking.get(device):
            return self._earlier(engine, device, end, tariff)
        done = self._done.get(device)
        with engine.connect() as connection:
            of_device = energy_quarter.c.device == device
            newest = connection.execute(sa.select(sa.func.max(energy_quarter.c.start)).where(of_device)).scalar()
            begin = _first(connection, device) or end - _DAY_S
            thorough = newest is not None and now - self._thorough.get(device, 0.0) >= _DAY_S
            if thorough:
                begin = int(newest or 0) - _LATE_DAYS_S
                lacking = _without_line(connection, device, end - _FURTHEST_S, begin)
                self._lacking[device] = sorted(lacking - self._without.get(device, set()))
            elif newest is not None or done is not None:
                begin = (done or int(newest or 0)) - _LATE_S
                begin = min(begin, _first_unpriced(connection, device, begin, tariff))
        begin = max(begin // QUARTER_S * QUARTER_S, end - _FURTHEST_S)
        until = min(begin + _AT_ONCE_S, end)
        rows = _periods(engine, device, range(begin, until + 1, QUARTER_S), tariff)
        _store(engine, device, rows, tariff)
        self._done[device] = until
        if thorough:
            self._thorough[device] = now
        return len(rows)

    def _earlier(self, engine: sa.Engine, device: str, end: int, tariff: Tariff) -> int:
        """Lines of quarter hours whose rows came days late, or whose lines were deleted; others stay as they are."""
        lacking = self._lacking[device]
        until = min(lacking[0] + _AT_ONCE_S, end)
        mine = {start for start in lacking if start < until}
        cuts = range(lacking[0], max(mine) + QUARTER_S + 1, QUARTER_S)
        rows = [one for one in _periods(engine, device, cuts, tariff) if one.begin in mine]
        _store(engine, device, rows, tariff)
        self._without.setdefault(device, set()).update(mine - {one.begin for one in rows})
        self._lacking[device] = [start for start in lacking if start >= until]
        return len(rows)


def _periods(engine: sa.Engine, device: str, cuts: Sequence[int], tariff: Tariff) -> list[Period]:
    """Quarter hours with a reading; without a cost where the series of prices has not begun, or has ended."""
    parts = [cuts]
    if isinstance(tariff.price, Series):
        first, last = int(tariff.price.start[0]), tariff.price.end
        known = [at for at in cuts if first <= at <= last]
        if known:
            parts = [[at for at in cuts if at <= known[0]], known, [at for at in cuts if at >= known[-1]]]
    parts = [part for part in parts if len(part) > 1]
    try:
        accounts = read_accounts(engine, device, parts, tariff) if parts else []
    except UserError:  # no rows
        return []
    return [one for account in accounts for one in account.periods if one.nWh is not None]


def _store(engine: sa.Engine, device: str, periods: Collection[Period], tariff: Tariff) -> None:
    if not periods:
        return
    rows = [_row(device, one, tariff) for one in periods]
    with transaction(engine) as connection:
        insert: Any = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
        statement = insert(energy_quarter)
        new, old = statement.excluded, energy_quarter.c
        changed = {name: new[name] for name in ("kWh", "EUR", "missing_s", "tariff")}
        # a cost that was known stays with its tariff, where prices have gone since and the energy is the same
        kept = sa.and_(new.EUR.is_(None), old.EUR.is_not(None), new.kWh == old.kWh)
        changed |= {name: sa.case((kept, old[name]), else_=new[name]) for name in ("EUR", "tariff")}
        connection.execute(statement.on_conflict_do_update(index_elements=["device", "start"], set_=changed), rows)


def _first(connection: sa.Connection, device: str) -> int | None:
    """Start of the first roll-up."""
    starts = [
        connection.execute(sa.select(sa.func.min(table.c.start)).where(table.c.device == device)).scalar()
        for table in ROLLUPS.values()
    ]
    return min((int(start) for start in starts if start is not None), default=None)


def _without_line(connection: sa.Connection, device: str, begin: int, end: int) -> set[int]:
    """Quarter hours between two Unix times [s] with roll-ups and without a line."""
    found: set[int] = set()
    for table in ROLLUPS.values():
        start = table.c.start - table.c.start % QUARTER_S
        within = (table.c.device == device, table.c.start >= begin, table.c.start < end)
        found.update(map(int, connection.execute(sa.select(start).where(*within).distinct()).scalars()))
    line = energy_quarter.c
    lines = sa.select(line.start).where(line.device == device, line.start >= begin, line.start < end)
    return found - set(map(int, connection.execute(lines).scalars()))


def _first_unpriced(connection: sa.Connection, device: str, begin: int, tariff: Tariff) -> int:
    """The first line of the two days before `begin` that lacks a cost and has a price by now; else `begin`."""
    if not isinstance(tariff.price, Series):
        return begin
    line = energy_quarter.c
    first, last = max(begin - _LATE_DAYS_S, int(tariff.price.start[0])), min(begin, tariff.price.end)
    query = sa.select(sa.func.min(line.start)).where(
        line.device == device, line.EUR.is_(None), line.start >= first, line.start < last
    )
    found = connection.execute(query).scalar()
    return begin if found is None else int(found)


def _row(device: str, one: Period, tariff: Tariff) -> dict[str, Any]:
    cost = None if one.cost is None or one.unpriced_nWh else float(one.cost)
    return {
        "device": device, "start": one.begin, "kWh": one.kWh, "EUR": cost, "missing_s": round(one.missing_s, 3),
        "tariff": tariff.name,
    }  # fmt: skip
