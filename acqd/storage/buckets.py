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
from acqd.timestamps import filetime, unix_s

_TICKS = 10_000_000
_FULL = 0.998
"""Share of the rows of the fullest bucket: a row more or less is how buckets and rows lie to each other."""
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

    def chosen(self, places: Sequence[int]) -> Buckets:
        """Some of them, by their places."""
        at = np.array(places, dtype=np.int64)
        return Buckets(
            self.start[at], self.seconds[at], self.rows[at], self.P[at], self.P_min[at], self.P_max[at],
            tuple(self.W[k] for k in places),
        )  # fmt: skip

    @classmethod
    def of(cls, rows: Sequence[_Row]) -> Buckets:
        """From rows of SQL, in any order."""
        ordered = sorted(rows, key=lambda row: row[0])
        start, seconds, count = (np.array([row[k] for row in ordered], dtype=np.int64) for k in range(3))
        P, P_min, P_max = (np.array([row[k] for row in ordered], dtype=np.float64) for k in (3, 4, 5))
        return cls(start, seconds, count, P, P_min, P_max, tuple(row[6] for row in ordered))


class Kept:
    """Buckets of rows that have been read and are full: whoever asks again and again reads only what is new."""

    def __init__(self) -> None:
        self._rows: dict[int, _Row] = {}
        self._most = 0
        """Rows of the fullest bucket so far."""

    def between(self, begin: int, end: int, known: Sequence[_Row]) -> list[_Row]:
        """Kept buckets between two Unix times [s], without those that have a roll-up; older ones are forgotten."""
        rolled_up = {row[0] for row in known}
        self._rows = {start: row for start, row in self._rows.items() if start >= begin and start not in rolled_up}
        return [row for row in self._rows.values() if row[0] + row[1] <= end]

    def add(self, rows: Sequence[_Row]) -> None:
        """Keep those that lack hardly a row: into the others, rows may still come."""
        self._most = max([self._most, *(row[2] for row in rows)])
        self._rows |= {row[0]: row for row in rows if row[2] >= _FULL * self._most}


def read_buckets(
    connection: sa.Connection, device: str, channel: str, seconds: int, begin: int, end: int, kept: Kept | None = None
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
    found += kept.between(begin, end, found) if kept is not None else []
    for first, last in _missing(found, begin, end):
        rows = _from_rows(connection, device, channel, seconds, first, last)
        found += rows
        if kept is not None:
            kept.add(rows)
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
    """Whether the newest row between two Unix times [s] has a flag; where only roll-ups are left, see below."""
    c = power.c
    query = sa.select(c.flags).where(c.device == device, c.channel == channel)
    query = query.where(c.filetime >= _ticks(begin), c.filetime < _ticks(end)).order_by(c.filetime.desc()).limit(1)
    flags = connection.execute(query).scalar()
    return newest_has_flag(connection, device, flag) if flags is None else flag in flags


def newest_has_flag(connection: sa.Connection, device: str, flag: str) -> bool:
    """Whether the newest row of a device has a flag: the only witness of times whose rows are deleted."""
    ends = _ends_of_rows(connection, device)
    if ends is None:
        return False
    query = sa.select(power.c.flags).where(power.c.device == device, power.c.filetime == ends[1]).limit(1)
    return flag in (connection.execute(query).scalar() or ())


def stored_span(connection: sa.Connection, device: str) -> tuple[int, int] | None:
    """Unix times [s] of the first and the last row or roll-up of a device; None without any."""
    bounds: list[tuple[float | None, float | None]] = []
    for seconds, table in ROLLUPS.items():
        query = sa.select(sa.func.min(table.c.start), sa.func.max(table.c.start) + seconds)
        bounds += [tuple(row) for row in connection.execute(query.where(table.c.device == device))]
    if ends := _ends_of_rows(connection, device):
        bounds.append((unix_s(ends[0]), unix_s(ends[1])))
    known = [(int(first), int(last)) for first, last in bounds if first is not None and last is not None]
    return (min(first for first, _ in known), max(last for _, last in known)) if known else None


def _ends_of_rows(connection: sa.Connection, device: str) -> tuple[int, int] | None:
    """`filetime` of the first and the last row of a device; in SQLite not by the view, which would be sorted whole."""
    if connection.dialect.name == "sqlite" and not conversion.unfinished(connection):
        return numbered_rows.stored_between(connection, device)
    at = sa.select(power.c.filetime).where(power.c.device == device).limit(1)
    first, last = (
        connection.execute(at.order_by(order)).scalar() for order in (power.c.filetime, power.c.filetime.desc())
    )
    return None if first is None or last is None else (int(first), int(last))


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
        return _from_numbered(connection, device, channel, seconds, _ticks(begin), _ticks(end))
    c = power.c
    start = ((c.filetime - filetime(0)) // (_TICKS * seconds) * seconds).label("start")
    columns = (start, sa.literal(seconds), sa.func.count(), sa.func.avg(c.P), sa.func.min(c.P), sa.func.max(c.P))
    within = (c.device == device, c.channel == channel, c.filetime >= _ticks(begin), c.filetime < _ticks(end))
    grouped = sa.select(*columns, sa.func.max(c.filetime)).where(*within).group_by(sa.text("start"))
    rows = connection.execute(grouped).all()
    return [(*row[:6], _reading(connection, device, channel, row[6], row[6] + 1, newest=True)) for row in rows]


def _from_numbered(
    connection: sa.Connection, device: str, channel: str, seconds: int, first: int, last: int
) -> list[_Row]:
    """The same in SQLite, by the ids of the device's runs: rows of other devices are not looked at."""
    start = f"(filetime - {filetime(0)}) / {_TICKS * seconds} * {seconds}"
    query = (
        f"SELECT {start} AS start, {seconds}, count(*), avg(P), min(P), max(P), max(filetime) FROM power_row"
        " NOT INDEXED WHERE id >= ? AND id < ? AND id & 3 = ? AND filetime >= ? AND filetime < ? GROUP BY 1"
    )
    at_end = "SELECT max(W) FROM power_row WHERE filetime = ? AND +id >= ? AND +id < ? AND id & 3 = ?"  # by the time
    buckets: dict[int, tuple[Any, ...]] = {}
    for low, high, code in numbered_rows.ids_between(connection, device, channel, first, last):
        for row in connection.exec_driver_sql(query, (low, high, code, first, last)):
            other = buckets.get(row[0])
            buckets[row[0]] = (*row, low, high, code) if other is None else _both(other, (*row, low, high, code))
    found: list[_Row] = []
    for begin, length, count, mean, least, most, ticks, low, high, code in buckets.values():
        W = connection.exec_driver_sql(at_end, (ticks, low, high, code)).scalar()
        found.append((begin, length, count, mean, least, most, W))
    return found


def _both(one: tuple[Any, ...], other: tuple[Any, ...]) -> tuple[Any, ...]:
    """A bucket in which a daemon has been started again: rows of two runs, and where the newest is."""
    rows = one[2] + other[2]
    P = [(bucket[2], bucket[3]) for bucket in (one, other) if bucket[3] is not None]
    mean = sum(n * p for n, p in P) / sum(n for n, _ in P) if P else None
    least, most = ([bucket[k] for bucket in (one, other) if bucket[k] is not None] for k in (4, 5))
    newest = max(one, other, key=lambda bucket: bucket[6])
    return (*one[:2], rows, mean, min(least, default=None), max(most, default=None), *newest[6:])


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
