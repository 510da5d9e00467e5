"""Energy readings and powers of one device in buckets of time: from roll-ups, and from rows where these lack."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import sqlalchemy as sa

from acqd.arrays import Floats
from acqd.storage import conversion, numbered_rows
from acqd.storage.schema import ROLLUPS, power
from acqd.timestamps import filetime

_TICKS = 10_000_000
_Row: TypeAlias = tuple[int, int, int, float | None, float | None, float | None, float | None]
"""Start [s], length [s], number of rows; mean, least and largest P [W]; W at the end [kWh]."""


@dataclass(frozen=True, slots=True)
class Buckets:
    """Buckets in the order of time, only those with rows."""

    start: np.ndarray
    """[n] int64, Unix s."""
    seconds: np.ndarray
    """[n] int64, length."""
    rows: np.ndarray
    """[n] int64."""
    P: Floats
    """[n] W, mean of the rows; NaN for unknown, as below."""
    P_min: Floats
    P_max: Floats
    W: tuple[float | None, ...]
    """[n] kWh, reading after the last row."""

    @classmethod
    def of(cls, rows: Sequence[_Row]) -> Buckets:
        """From rows of SQL, in any order."""
        ordered = sorted(rows, key=lambda row: row[0])
        start, seconds, count = (np.array([row[k] for row in ordered], dtype=np.int64) for k in range(3))
        P, P_min, P_max = (np.array([row[k] for row in ordered], dtype=np.float64) for k in (3, 4, 5))
        return cls(start, seconds, count, P, P_min, P_max, tuple(row[6] for row in ordered))


def read_buckets(
    connection: sa.Connection, device: str, channel: str, seconds: int, begin: int, end: int
) -> tuple[Buckets, int]:
    """Buckets of `seconds` (60 or 900) between two Unix times [s] that are multiples of it, and the one before.

    What has no roll-up yet comes from rows, and what has none of a minute any more from those of quarter hours. The
    number is how many buckets lie before `begin`: 0 or 1.
    """
    found = _rolled_up(connection, device, channel, seconds, begin, end)
    if seconds < 900:
        have = {row[0] // 900 for row in found}
        coarse = _rolled_up(connection, device, channel, 900, begin - begin % 900, end)
        found += [row for row in coarse if row[0] // 900 not in have and begin <= row[0] and row[0] + 900 <= end]
    for first, last in _missing(found, begin, end):
        found += _from_rows(connection, device, channel, seconds, first, last)
    before = _before(connection, device, channel, begin)
    return Buckets.of([*before, *found]), len(before)


def first_reading(connection: sa.Connection, device: str, channel: str, begin: int, end: int) -> float | None:
    """W [kWh] of the first row between two Unix times [s] that has one."""
    return _reading(connection, device, channel, _ticks(begin), _ticks(end), newest=False)


def row_interval(connection: sa.Connection, device: str, channel: str, begin: int, end: int) -> float | None:
    """Time from row to row [s], the median of the newest between two Unix times [s]; None where no rows are kept."""
    c = power.c
    newest = sa.select(c.boot, c.seq, c.filetime).where(c.device == device, c.channel == channel)
    newest = newest.where(c.filetime >= _ticks(begin), c.filetime < _ticks(end))
    rows = connection.execute(newest.order_by(c.filetime.desc()).limit(50)).all()
    steps = [
        (later[2] - earlier[2]) / (later[1] - earlier[1]) / _TICKS
        for later, earlier in pairwise(rows)
        if later[0] == earlier[0] and later[1] > earlier[1]
    ]
    return float(np.median(steps)) if steps else None


def has_flag(connection: sa.Connection, device: str, channel: str, begin: int, end: int, flag: str) -> bool:
    """Whether the newest row between two Unix times [s] has a flag."""
    c = power.c
    query = sa.select(c.flags).where(c.device == device, c.channel == channel)
    query = query.where(c.filetime >= _ticks(begin), c.filetime < _ticks(end)).order_by(c.filetime.desc()).limit(1)
    return flag in (connection.execute(query).scalar() or ())


def channels(connection: sa.Connection, device: str, begin: int, end: int) -> set[str]:
    """Channels of a device with roll-ups or rows between two Unix times [s]."""
    known: set[str] = set()
    for table in ROLLUPS.values():
        query = sa.select(table.c.channel).where(table.c.device == device, table.c.start >= begin, table.c.start < end)
        known |= set(connection.execute(query.distinct()).scalars())
    c = power.c
    within = (c.device == device, c.filetime >= _ticks(begin), c.filetime < _ticks(end))
    newest = sa.select(c.channel).where(*within).order_by(c.filetime.desc()).limit(50)
    return known | set(connection.execute(newest).scalars())


def devices(connection: sa.Connection) -> list[str]:
    """Devices with roll-ups, by name."""
    names: set[str] = set()
    for table in ROLLUPS.values():
        names |= set(connection.execute(sa.select(table.c.device).distinct()).scalars())
    return sorted(names)


def _rolled_up(connection: sa.Connection, device: str, channel: str, seconds: int, begin: int, end: int) -> list[_Row]:
    c = ROLLUPS[seconds].c
    query = sa.select(c.start, sa.literal(seconds), c.rows, c.P, c.P_min, c.P_max, c.W)
    query = query.where(c.device == device, c.channel == channel, c.start >= begin, c.start < end)
    return [tuple(row) for row in connection.execute(query)]


def _before(connection: sa.Connection, device: str, channel: str, begin: int) -> list[_Row]:
    """The newest bucket before `begin` that has a reading."""
    best: list[_Row] = []
    for seconds, table in ROLLUPS.items():
        c = table.c
        query = sa.select(c.start, sa.literal(seconds), c.rows, c.P, c.P_min, c.P_max, c.W)
        query = query.where(c.device == device, c.channel == channel, c.start <= begin - seconds, c.W.is_not(None))
        best += [tuple(row) for row in connection.execute(query.order_by(c.start.desc()).limit(1))]
    newest = max((row[0] + row[1] for row in best), default=0)
    if newest < begin:
        c = power.c
        within = (c.device == device, c.channel == channel, c.filetime < _ticks(begin), c.W.is_not(None))
        query = sa.select(c.filetime).where(*within, c.filetime >= _ticks(newest)).order_by(c.filetime.desc()).limit(1)
        stamp = connection.execute(query).scalar()
        if stamp is not None:
            start = (int(stamp) - filetime(0)) // (60 * _TICKS) * 60
            best += _from_rows(connection, device, channel, 60, start, min(start + 60, begin))
    return [max(best, key=lambda row: row[0] + row[1])] if best else []


def _missing(found: Sequence[_Row], begin: int, end: int) -> Iterator[tuple[int, int]]:
    """Spans between `begin` and `end` without a bucket."""
    at = begin
    for row in sorted(found):
        if row[0] > at:
            yield at, row[0]
        at = max(at, row[0] + row[1])
    if at < end:
        yield at, end


def _from_rows(connection: sa.Connection, device: str, channel: str, seconds: int, begin: int, end: int) -> list[_Row]:
    """Buckets of rows, as `maintain` makes them."""
    if connection.dialect.name == "sqlite" and not conversion.unfinished(connection):
        where, parameters = numbered_rows.of_channel(connection, device, channel)
        if not where:
            return []
        ticks = f"{_TICKS * seconds}"
        query = (
            f"SELECT (filetime - {filetime(0)}) / {ticks} * {seconds} AS start, {seconds}, count(*), avg(P), min(P),"
            f" max(P), max(filetime) FROM power_row WHERE filetime >= ? AND filetime < ? AND {where} GROUP BY 1"
        )
        rows = connection.exec_driver_sql(query, (_ticks(begin), _ticks(end), *parameters)).all()
        at_end = f"SELECT max(W) FROM power_row WHERE filetime = ? AND {where}"
        return [(*row[:6], connection.exec_driver_sql(at_end, (row[6], *parameters)).scalar()) for row in rows]
    c = power.c
    start = ((c.filetime - filetime(0)) // (_TICKS * seconds) * seconds).label("start")
    columns = (start, sa.literal(seconds), sa.func.count(), sa.func.avg(c.P), sa.func.min(c.P), sa.func.max(c.P))
    within = (c.device == device, c.channel == channel, c.filetime >= _ticks(begin), c.filetime < _ticks(end))
    grouped = sa.select(*columns, sa.func.max(c.filetime)).where(*within).group_by(sa.text("start"))
    rows = connection.execute(grouped).all()
    return [(*row[:6], _reading(connection, device, channel, row[6], row[6] + 1, newest=True)) for row in rows]


def _reading(
    connection: sa.Connection, device: str, channel: str, first: int, last: int, *, newest: bool
) -> float | None:
    """W of the newest or oldest row with `first` <= filetime < `last`; of rows at the same time the largest."""
    c = power.c
    within = (c.device == device, c.channel == channel, c.filetime >= first, c.filetime < last, c.W.is_not(None))
    order: Any = c.filetime.desc() if newest else c.filetime
    found = connection.execute(sa.select(c.W).where(*within).order_by(order, c.W.desc()).limit(1)).scalar()
    return None if found is None else float(found)


def _ticks(unix: int) -> int:
    return filetime(unix * 1_000_000_000)
