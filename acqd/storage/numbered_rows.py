"""Rows in SQLite: numbers instead of names, no value that follows from others (ADR 42).

The id of a row is run << 34 | (seq - base) << 2 | channel. A run is a device and a boot (and 2^32 windows of it). A
mark is a list of flags, and whether S is Vrms * Irms and PF is P / S, to the last bit: then they are not stored. A time
that is not the text of `filetime` has a row in `power_stamp`. The view `power` puts all of that together again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeAlias

import orjson
import sqlalchemy as sa

from acqd.storage.migrations.versions.m0010_numbered_rows import SELECT
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.timestamps import filetime, rfc3339, utc_ns

_CODES: dict[str, int] = {name: code for code, name in enumerate(CHANNELS)}
_AT_ONCE = 500
_INSERT = f"INSERT INTO power_row VALUES ({', '.join('?' * 10)})"
_FIRST, _LAST = filetime(0), filetime(253_402_300_800 * 10**9)
"""1970 to 9999: where SQLite and Python make the same text."""


_Numbered: TypeAlias = tuple[int, int, int, float | None, float | None, float | None, float | None, float | None,
    float | None, float | None]  # fmt: skip
"""A row of `power_row`: id, mark, filetime, Vrms, Irms, P, S, PF, f, W."""


def insert(connection: sa.Connection, rows: Sequence[PowerRow]) -> list[int]:
    """Insert what is new; positions in `rows` of those whose key is stored with other values. SQLite only."""
    numbered, odd = _Numbers(connection).of(rows)
    if odd:
        first: dict[int, str | None] = {}
        for k, one in enumerate(numbered):
            first.setdefault(one[0], odd.get(k))
        known = {number for number, *_ in _stored(connection, first)}
        stamps = [(number, time) for number, time in first.items() if time is not None and number not in known]
        if stamps:
            connection.exec_driver_sql("INSERT INTO power_stamp VALUES (?, ?)", stamps)
    try:
        connection.exec_driver_sql(_INSERT, numbered)
        return []
    except sa.exc.IntegrityError:  # a key is there already; rows before it are inserted, and equal to themselves
        connection.exec_driver_sql(f"{_INSERT} ON CONFLICT DO NOTHING", numbered)
    stored = {number: rest for number, *rest in _stored(connection, {one[0] for one in numbered})}
    return [k for k, one in enumerate(numbered) if stored[one[0]] != [*one[1:], odd.get(k)]]


def stored_row(connection: sa.Connection, row: PowerRow) -> dict[str, Any]:
    """The stored row with the key of `row`, as the view has it."""
    number = _Numbers(connection).of([row])[0][0][0]
    return dict(connection.exec_driver_sql(f"{SELECT} WHERE v.id = ?", (number,)).mappings().one())


def runs(connection: sa.Connection, device: str, boot: str) -> list[tuple[int, str, int]]:
    """Id, boot and first window of the runs of a boot and its continuations (`boot.1`), newest first."""
    query = (
        "SELECT id, boot, base FROM power_run WHERE device = ? AND boot >= ? AND boot < ? AND channel = ''"
        " ORDER BY boot DESC, base DESC"
    )
    found = connection.exec_driver_sql(query, (device, boot, f"{boot}/"))  # "/" follows "."
    return [(int(number), str(name), int(base)) for number, name, base in found]


def ids_between(
    connection: sa.Connection, device: str, channel: str, first: int, last: int
) -> list[tuple[int, int, int]]:
    """Of every run of a channel with rows of `first` <= filetime < `last`: least id, id after the last, code.

    Within a run, time rises with the id (ADR 16), so both ends are found by bisection; `id & 3` is the code.
    """
    code = _CODES.get(channel)
    query = "SELECT id FROM power_run WHERE device = ? AND channel = ?"
    found = []
    for run in connection.exec_driver_sql(query, (device, "" if code is not None else channel)).scalars().all():
        low, high = (_first_id(connection, run, ticks) for ticks in (first, last))
        if low < high:
            found.append((low, high, code or 0))
    return found


def _first_id(connection: sa.Connection, run: int, ticks: int) -> int:
    """The least id of a run whose row, or the next one after it, has filetime >= `ticks`; else the end of the run."""
    low, high = run << 34, (run + 1) << 34
    end = high
    while low < high:
        middle = (low + high) // 2
        query = "SELECT filetime FROM power_row WHERE id >= ? AND id < ? ORDER BY id LIMIT 1"
        at = connection.exec_driver_sql(query, (middle, end)).scalar()
        if at is None or at >= ticks:
            high = middle
        else:
            low = middle + 1
    return low


def last_of_run(connection: sa.Connection, run: int, channel: str) -> tuple[int, float] | None:
    """Window within the run, and W, of the newest row of a channel that has a W."""
    query = (
        'SELECT id, "W" FROM power_row WHERE id >= ? AND id < ? AND id & 3 = ? AND "W" IS NOT NULL'
        " ORDER BY id DESC LIMIT 1"
    )
    row = connection.exec_driver_sql(query, (run << 34, (run + 1) << 34, _CODES[channel])).one_or_none()
    return None if row is None else (int(row[0]) >> 2 & 0xFFFFFFFF, float(row[1]))


class _Numbers:
    """Numbers of runs and marks, for the rows of one transaction; new ones are made."""

    def __init__(self, connection: sa.Connection) -> None:
        self._connection = connection
        self._bases: dict[tuple[str, str, str, int], int] = {}
        self._marks: dict[tuple[tuple[str, ...], bool, bool, int], int] = {}

    def of(self, rows: Sequence[PowerRow]) -> tuple[list[_Numbered], dict[int, str]]:
        """The rows with numbers; by position, the times that do not follow from `filetime`."""
        numbered: list[_Numbered] = []
        odd: dict[int, str] = {}
        bases, marks, ticks, text = self._bases, self._marks, -1, ""
        for k, row in enumerate(rows):
            if row.filetime != ticks:  # the channels of a window follow one another
                ticks = row.filetime
                text = rfc3339(utc_ns(ticks)) if _FIRST <= ticks < _LAST else ""
            if row.time != text:
                odd[k] = row.time
            channel, seq, flags, Vrms, Irms, P, S, PF = (
                row.channel, row.seq, row.flags, row.Vrms, row.Irms, row.P, row.S, row.PF,
            )  # fmt: skip
            S_follows = Vrms is not None and Irms is not None and Vrms * Irms == S
            PF_follows = PF is not None and P is not None and S is not None and S != 0 and P / S == PF
            key = row.device, channel, row.boot, seq >> 32
            mark = tuple(flags) if flags else (), S_follows, PF_follows, row.schema
            numbered.append((
                (bases.get(key) or self._base(*key)) | (seq & 0xFFFFFFFF) << 2, marks.get(mark) or self._mark(*mark),
                ticks, Vrms, Irms, P, None if S_follows else S, None if PF_follows else PF, row.f, row.W,
            ))  # fmt: skip
        return numbered, odd

    def _base(self, device: str, channel: str, boot: str, block: int) -> int:
        """The id of a row of this channel whose seq is `block` << 32."""
        code = _CODES.get(channel)
        run = device, boot, "" if code is not None else channel, block << 32
        self._connection.exec_driver_sql(
            "INSERT OR IGNORE INTO power_run (device, boot, channel, base) VALUES (?, ?, ?, ?)", run
        )
        query = "SELECT id FROM power_run WHERE device = ? AND boot = ? AND channel = ? AND base = ?"
        number = int(self._connection.exec_driver_sql(query, run).scalar_one())
        self._bases[device, channel, boot, block] = base = number << 34 | (code or 0)
        return base

    def _mark(self, flags: tuple[str, ...], S_follows: bool, PF_follows: bool, schema: int) -> int:
        mark = orjson.dumps(flags).decode(), S_follows, PF_follows, schema
        self._connection.exec_driver_sql(
            'INSERT OR IGNORE INTO power_mark (flags, "S", "PF", "schema") VALUES (?, ?, ?, ?)', mark
        )
        query = 'SELECT id FROM power_mark WHERE flags = ? AND "S" = ? AND "PF" = ? AND "schema" = ?'
        number = int(self._connection.exec_driver_sql(query, mark).scalar_one())
        self._marks[flags, S_follows, PF_follows, schema] = number
        return number


def _stored(connection: sa.Connection, ids: Iterable[int]) -> Iterator[tuple[Any, ...]]:
    """Rows of `power_row` with these ids, and their times where they do not follow."""
    asked = list(ids)
    for begin in range(0, len(asked), _AT_ONCE):
        some = asked[begin : begin + _AT_ONCE]
        places = ", ".join("?" * len(some))
        query = f'SELECT v.*, t."time" FROM power_row v LEFT JOIN power_stamp t USING (id) WHERE v.id IN ({places})'
        yield from (tuple(row) for row in connection.exec_driver_sql(query, tuple(some)))
