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
from msgspec.structs import astuple

from acqd.storage.away import left_out
from acqd.storage.migrations.versions.m0010_numbered_rows import SELECT
from acqd.telemetry.row import CHANNELS, SCHEMA, PowerRow
from acqd.timestamps import filetime, rfc3339, utc_ns

_CODES: dict[str, int] = {name: code for code, name in enumerate(CHANNELS)}
_AT_ONCE = 500
_PLACES = f"({', '.join('?' * 10)})"
_COLUMNS, _TOGETHER = 10, 90
"""Rows of one statement: 900 parameters, and every SQLite takes 999."""
_FIRST, _LAST = filetime(0), filetime(253_402_300_800 * 10**9)
"""1970 to 9999: where SQLite and Python make the same text."""


_WINDOWS = 1 << 32
"""Of a run."""
_SECOND, _NEVER = 10_000_000, -(1 << 62)
"""Ticks of `filetime`; a second of no row."""

_Values: TypeAlias = list[Any]
"""Of rows of `power_row`, one after another: id, mark, filetime, Vrms, Irms, P, S, PF, f, W."""


def insert(connection: sa.Connection, rows: Sequence[PowerRow]) -> list[int]:
    """Insert what is new; positions in `rows` of those whose key is stored with other values. SQLite only.

    Raises the errors of SQLAlchemy; DatabaseAwayError where the database drops rows without an error.
    """
    values, odd = _Numbers(connection).of(rows)
    if odd:
        first: dict[int, str | None] = {}
        for k, number in enumerate(values[::_COLUMNS]):
            first.setdefault(number, odd.get(k))
        known = {number for number, *_ in _stored(connection, first)}
        stamps = [(number, time) for number, time in first.items() if time is not None and number not in known]
        if stamps:
            taken = connection.exec_driver_sql("INSERT INTO power_stamp VALUES (?, ?)", stamps).rowcount
            if taken < len(stamps):
                raise left_out(connection, len(stamps) - taken)
    try:
        if _insert_new(connection, values) == len(rows):
            return []
    except sa.exc.IntegrityError:  # a key is there already; rows before it are inserted, and equal to themselves
        if not under_way(connection):
            raise
    each = _cut(values, _COLUMNS)
    connection.exec_driver_sql(f"INSERT INTO power_row VALUES {_PLACES} ON CONFLICT DO NOTHING", each)
    stored = {number: rest for number, *rest in _stored(connection, {one[0] for one in each})}
    if missing := sum(one[0] not in stored for one in each):
        raise left_out(connection, missing)
    return [k for k, one in enumerate(each) if stored[one[0]] != [*one[1:], odd.get(k)]]


def under_way(connection: sa.Connection) -> bool:
    """Whether the transaction is: a trigger can end it with an error, and what follows would be stored alone."""
    opened: Any = connection.connection.dbapi_connection
    return bool(opened.in_transaction)


def stored_row(connection: sa.Connection, row: PowerRow) -> dict[str, Any]:
    """The stored row with the key of `row`, as the view has it."""
    number = _Numbers(connection).of([row])[0][0]
    return dict(connection.exec_driver_sql(f"{SELECT} WHERE v.id = ?", (number,)).mappings().one())


def runs(connection: sa.Connection, device: str, boot: str) -> list[tuple[int, str, int]]:
    """Id, boot and first window of the runs of a boot and its continuations (`boot.1`), newest first."""
    query = (
        "SELECT id, boot, base FROM power_run WHERE device = ? AND boot >= ? AND boot < ? AND channel = ''"
        " ORDER BY boot DESC, base DESC"
    )
    found = connection.exec_driver_sql(query, (device, boot, f"{boot}/"))  # "/" follows "."
    return [(int(number), str(name), int(base)) for number, name, base in found]


_OLDEST, _NEWEST = (
    "SELECT filetime FROM power_row WHERE id >= power_run.id << 34 AND id < (power_run.id + 1) << 34"
    f" ORDER BY id {order} LIMIT 1"
    for order in ("ASC", "DESC")
)
_RUNS = f"SELECT id, ({_OLDEST}) AS oldest, ({_NEWEST}) AS newest FROM power_run WHERE device = ?"
"""Runs of a device with the times of their first and last row: within a run, time rises with the id (ADR 16)."""


def stored_between(connection: sa.Connection, device: str) -> tuple[int, int] | None:
    """`filetime` of the first and the last row of a device; None without rows."""
    query = f"SELECT min(oldest), max(newest) FROM ({_RUNS})"
    oldest, newest = connection.exec_driver_sql(query, (device,)).one()
    return None if oldest is None else (int(oldest), int(newest))


def ids_between(
    connection: sa.Connection, device: str, channel: str, first: int, last: int
) -> list[tuple[int, int, int]]:
    """Of every run of a channel with rows of `first` <= filetime < `last`: least id, id after the last, code.

    Within a run, time rises with the id (ADR 16), so both ends are found by bisection, in the runs whose first and last
    row say that they overlap the span; `id & 3` is the code.
    """
    code = _CODES.get(channel)
    query = f"SELECT id FROM ({_RUNS} AND channel = ?) WHERE oldest < ? AND newest >= ? ORDER BY id"
    asked = (device, "" if code is not None else channel, last, first)
    found = []
    for run in connection.exec_driver_sql(query, asked).scalars().all():
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


def _insert_new(connection: sa.Connection, values: _Values) -> int:
    """Insert; how many rows.

    Many a statement: in each, SQLite looks for the end of table and index once, and Python locks once.
    FAIL keeps the rows before the one that is there already; ABORT would first copy every page that it changes.
    """
    whole, taken = len(values) - len(values) % (_COLUMNS * _TOGETHER), 0
    for some, together in ((values[:whole], _TOGETHER), (values[whole:], 1)):
        if some:
            statement = f"INSERT OR FAIL INTO power_row VALUES {', '.join([_PLACES] * together)}"
            taken += connection.exec_driver_sql(statement, _cut(some, _COLUMNS * together)).rowcount
    return taken


def _cut(values: _Values, length: int) -> list[tuple[Any, ...]]:
    return [tuple(values[begin : begin + length]) for begin in range(0, len(values), length)]


class _Numbers:
    """Numbers of runs and marks, for the rows of one transaction; new ones are made."""

    def __init__(self, connection: sa.Connection) -> None:
        self._connection = connection
        self._runs: dict[tuple[str, str, int], dict[str, int]] = {}
        """By device, boot and first window: by channel, the id of window 0, if the run had that one."""
        self._marks: dict[tuple[Any, ...], int] = {}
        self._plain = [[0, 0], [0, 0]]
        """Marks without flags, by whether S and PF follow."""

    def of(self, rows: Sequence[PowerRow]) -> tuple[_Values, dict[int, str]]:
        """What is stored of the rows; by position, the times that do not follow from `filetime`."""
        values: _Values = []
        odd: dict[int, str] = {}
        marks, plain = self._marks, self._plain
        bases: dict[str, int] = {}
        device = boot = text = seconds = ""
        last, second, low, high = -1, _NEVER, 0, 0
        for k, (of, channel, start, seq, time, ticks, Vrms, Irms, P, S, PF, f, W, flags, schema) in enumerate(
            map(astuple, rows)  # in half of the time of attributes
        ):
            if ticks != last:  # the channels of a window follow one another
                last = ticks
                if not 0 <= ticks - second < _SECOND:
                    second = ticks - ticks % _SECOND
                    seconds = _until_second(ticks)
                text = f"{seconds}{(ticks - second) // 10:06d}Z"
            if time != text:
                odd[k] = time
            if start != boot or of != device or not low <= seq < high:
                device, boot, low = of, start, seq - seq % _WINDOWS
                high, bases = low + _WINDOWS, self._runs.setdefault((of, start, low), {})
            base = bases.get(channel)
            if base is None:
                bases |= self._bases(of, start, channel, low)
                base = bases[channel]
            S_follows = Vrms is not None and Irms is not None and Vrms * Irms == S
            PF_follows = PF is not None and P is not None and S is not None and S != 0 and P / S == PF
            if flags or schema != SCHEMA:
                mark = marks.get((schema, S_follows, PF_follows, *flags)) or self._mark(
                    schema, S_follows, PF_follows, *flags
                )
            else:
                mark = plain[S_follows][PF_follows] or self._mark(SCHEMA, S_follows, PF_follows)
            values += (
                base + (seq << 2), mark, ticks, Vrms, Irms, P,
                None if S_follows else S, None if PF_follows else PF, f, W,
            )  # fmt: skip
        return values, odd

    def _bases(self, device: str, boot: str, channel: str, low: int) -> dict[str, int]:
        """What `_runs` has of a channel; all that have a code share a run."""
        codes = _CODES if channel in _CODES else {channel: 0}
        key = device, boot, "" if channel in _CODES else channel, low
        query = "SELECT id FROM power_run WHERE device = ? AND boot = ? AND channel = ? AND base = ?"
        statement = "INSERT INTO power_run (device, boot, channel, base) VALUES (?, ?, ?, ?)"
        run = self._id(query, statement, key)
        return {name: (run << 34) + code - (low << 2) for name, code in codes.items()}

    def _mark(self, schema: int, S_follows: bool, PF_follows: bool, *flags: str) -> int:
        query = 'SELECT id FROM power_mark WHERE flags = ? AND "S" = ? AND "PF" = ? AND "schema" = ?'
        statement = 'INSERT INTO power_mark (flags, "S", "PF", "schema") VALUES (?, ?, ?, ?)'
        number = self._id(query, statement, (orjson.dumps(flags).decode(), S_follows, PF_follows, schema))
        self._marks[schema, S_follows, PF_follows, *flags] = number
        if not flags and schema == SCHEMA:
            self._plain[S_follows][PF_follows] = number
        return number

    def _id(self, query: str, statement: str, values: tuple[Any, ...]) -> int:
        """The id of the row that `query` asks for; `statement` makes it where it is not there yet."""
        number = self._connection.exec_driver_sql(query, values).scalar()
        if number is None:
            self._connection.exec_driver_sql(statement, values)
            number = self._connection.exec_driver_sql(query, values).scalar()
        if number is None:
            raise left_out(self._connection, 1)
        return int(number)


def _until_second(ticks: int) -> str:
    """The time of `ticks` up to the point; empty where SQLite and Python do not make the same text."""
    return rfc3339(utc_ns(ticks - ticks % _SECOND))[:20] if _FIRST <= ticks < _LAST else ""


def _stored(connection: sa.Connection, ids: Iterable[int]) -> Iterator[tuple[Any, ...]]:
    """Rows of `power_row` with these ids, and their times where they do not follow."""
    asked = list(ids)
    for begin in range(0, len(asked), _AT_ONCE):
        some = asked[begin : begin + _AT_ONCE]
        places = ", ".join("?" * len(some))
        query = f'SELECT v.*, t."time" FROM power_row v LEFT JOIN power_stamp t USING (id) WHERE v.id IN ({places})'
        yield from (tuple(row) for row in connection.exec_driver_sql(query, tuple(some)))
