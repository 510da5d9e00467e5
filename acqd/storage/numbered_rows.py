"""Rows in SQLite: numbers instead of names, no value that follows from others (ADR 42).

The id of a row is run << 34 | (seq - base) << 2 | channel. A run is a device and a boot (and 2^32 windows of it). A
mark is a list of flags, and whether S is Vrms * Irms and PF is P / S, to the last bit: then they are not stored. A time
that is not the text of `filetime` has a row in `power_stamp`. The view `power` puts all of that together again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import sqlalchemy as sa

from acqd.storage.migrations.versions.m0010_numbered_rows import SELECT
from acqd.telemetry.row import CHANNELS
from acqd.timestamps import filetime, rfc3339, utc_ns

_CODES: dict[str, int] = {name: code for code, name in enumerate(CHANNELS)}
_BASE = -1 << 32
_AT_ONCE = 500
_INSERT = f"INSERT INTO power_row VALUES ({', '.join('?' * 10)}) ON CONFLICT DO NOTHING"
_FIRST, _LAST = filetime(0), filetime(253_402_300_800 * 10**9)
"""1970 to 9999: where SQLite and Python make the same text."""


class Values(NamedTuple):
    """A row of `power`, in the order of its columns; flags as JSON."""

    device: str
    channel: str
    boot: str
    seq: int
    time: str
    filetime: int
    Vrms: float | None
    Irms: float | None
    P: float | None
    S: float | None
    PF: float | None
    f: float | None
    W: float | None
    flags: str
    schema: int


_Numbered: TypeAlias = tuple[int, int, int, float | None, float | None, float | None, float | None, float | None,
    float | None, float | None]  # fmt: skip
"""A row of `power_row`: id, mark, filetime, Vrms, Irms, P, S, PF, f, W."""


def insert(connection: sa.Connection, rows: Sequence[Values]) -> list[int]:
    """Insert what is new; positions in `rows` of those whose key is stored with other values. SQLite only."""
    numbers = _Numbers(connection)
    numbered = [numbers.of(row) for row in rows]
    odd = _odd(rows)
    if any(odd):
        first: dict[int, str | None] = {}
        for one, row, is_odd in zip(numbered, rows, odd, strict=True):
            first.setdefault(one[0], row.time if is_odd else None)
        known = {number for number, *_ in _stored(connection, first)}
        stamps = [(number, time) for number, time in first.items() if time is not None and number not in known]
        if stamps:
            connection.exec_driver_sql("INSERT INTO power_stamp VALUES (?, ?)", stamps)
    if connection.exec_driver_sql(_INSERT, numbered).rowcount == len(rows):
        return []
    stored = {number: rest for number, *rest in _stored(connection, {one[0] for one in numbered})}
    return [
        k
        for k, (one, row) in enumerate(zip(numbered, rows, strict=True))
        if stored[one[0]][:-1] != list(one[1:]) or stored[one[0]][-1] != (row.time if odd[k] else None)
    ]


def stored_row(connection: sa.Connection, row: Values) -> dict[str, Any]:
    """The stored row with the key of `row`, as the view has it."""
    number = _Numbers(connection).of(row)[0]
    return dict(connection.exec_driver_sql(f"{SELECT} WHERE v.id = ?", (number,)).mappings().one())


def runs(connection: sa.Connection, device: str, boot: str) -> list[tuple[int, str, int]]:
    """Id, boot and first window of the runs of a boot and its continuations (`boot.1`), newest first."""
    query = (
        "SELECT id, boot, base FROM power_run WHERE device = ? AND boot >= ? AND boot < ? AND channel = ''"
        " ORDER BY boot DESC, base DESC"
    )
    found = connection.exec_driver_sql(query, (device, boot, f"{boot}/"))  # "/" follows "."
    return [(int(number), str(name), int(base)) for number, name, base in found]


def of_channel(connection: sa.Connection, device: str, channel: str) -> tuple[str, tuple[int, ...]]:
    """Condition on `id` and its parameters for the rows of a device and channel; empty where there are no runs."""
    code = _CODES.get(channel)
    query = "SELECT id FROM power_run WHERE device = ? AND channel = ?"
    found = tuple(connection.exec_driver_sql(query, (device, "" if code is not None else channel)).scalars())
    if not found:
        return "", ()
    return f"id & 3 = {code or 0} AND id >> 34 IN ({', '.join('?' * len(found))})", found


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
        self._runs: dict[tuple[str, str, str, int], int] = {}
        self._marks: dict[tuple[str, bool, bool, int], int] = {}

    def of(self, row: Values) -> _Numbered:
        """The row with numbers."""
        device, channel, boot, seq, _, ticks, Vrms, Irms, P, S, PF, f, W, flags, schema = row
        S_follows = Vrms is not None and Irms is not None and Vrms * Irms == S
        PF_follows = PF is not None and P is not None and S is not None and S != 0 and P / S == PF
        mark = flags, S_follows, PF_follows, schema
        code = _CODES.get(channel)
        run = device, boot, "" if code is not None else channel, seq & _BASE
        return (
            (self._runs.get(run) or self._run(run)) << 34 | (seq & 0xFFFFFFFF) << 2 | (code or 0),
            self._marks.get(mark) or self._mark(mark),
            ticks, Vrms, Irms, P, None if S_follows else S, None if PF_follows else PF, f, W,
        )  # fmt: skip

    def _run(self, run: tuple[str, str, str, int]) -> int:
        self._connection.exec_driver_sql(
            "INSERT OR IGNORE INTO power_run (device, boot, channel, base) VALUES (?, ?, ?, ?)", run
        )
        query = "SELECT id FROM power_run WHERE device = ? AND boot = ? AND channel = ? AND base = ?"
        self._runs[run] = number = int(self._connection.exec_driver_sql(query, run).scalar_one())
        return number

    def _mark(self, mark: tuple[str, bool, bool, int]) -> int:
        self._connection.exec_driver_sql(
            'INSERT OR IGNORE INTO power_mark (flags, "S", "PF", "schema") VALUES (?, ?, ?, ?)', mark
        )
        query = 'SELECT id FROM power_mark WHERE flags = ? AND "S" = ? AND "PF" = ? AND "schema" = ?'
        self._marks[mark] = number = int(self._connection.exec_driver_sql(query, mark).scalar_one())
        return number


def _odd(rows: Sequence[Values]) -> list[bool]:
    """Whether the time of a row is another one than the view makes from its `filetime`."""
    odd, ticks, text = [], -1, ""
    for row in rows:
        if row[5] != ticks:  # the channels of a window follow one another
            ticks = row[5]
            text = rfc3339(utc_ns(ticks)) if _FIRST <= ticks < _LAST else ""
        odd.append(row[4] != text)
    return odd


def _stored(connection: sa.Connection, ids: Iterable[int]) -> Iterator[tuple[Any, ...]]:
    """Rows of `power_row` with these ids, and their times where they do not follow."""
    asked = list(ids)
    for begin in range(0, len(asked), _AT_ONCE):
        some = asked[begin : begin + _AT_ONCE]
        places = ", ".join("?" * len(some))
        query = f'SELECT v.*, t."time" FROM power_row v LEFT JOIN power_stamp t USING (id) WHERE v.id IN ({places})'
        yield from (tuple(row) for row in connection.exec_driver_sql(query, tuple(some)))
