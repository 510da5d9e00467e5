"""Rows into `power`: numbered in SQLite; in PostgreSQL with COPY, by a staging table when keys are there already."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import msgspec
import orjson
import sqlalchemy as sa

from acqd.storage import conversion, numbered_rows
from acqd.storage.away import left_out
from acqd.storage.schema import power
from acqd.storage.sink_flags import added, same_row
from acqd.telemetry.row import PowerRow

_COLUMNS = [column.name for column in power.columns]
_FLAGS = _COLUMNS.index("flags")
_KEY = ("device", "channel", "boot", "seq")
_QUOTED = ", ".join(f'"{name}"' for name in _COLUMNS)
_ON_KEY = " AND ".join(f'p."{name}" = a."{name}"' for name in _KEY)
_KEY_QUOTED = ", ".join(f'"{name}"' for name in _KEY)
_MOVE = (
    f"INSERT INTO power ({_QUOTED}) SELECT {_QUOTED} FROM ("
    f"SELECT DISTINCT ON ({_KEY_QUOTED}) * FROM arriving ORDER BY {_KEY_QUOTED}, number"
    f") a WHERE NOT EXISTS (SELECT 1 FROM power p WHERE {_ON_KEY}) ORDER BY number ON CONFLICT DO NOTHING"
)
"""Of each key the first row, if `power` has none: where a trigger puts rows into a table that inherits from `power`,
no key is there for ON CONFLICT."""

_CSV, _TEXT = "FORMAT csv, NULL 'null', ESCAPE '\\', ENCODING 'UTF8'", "FORMAT text"


def insert(connection: sa.Connection, rows: list[PowerRow]) -> list[int]:
    """Insert what is new; positions in `rows` of those whose key is stored with other values.

    Raises the errors of SQLAlchemy; DatabaseAwayError where the database drops rows without an error.
    """
    differing = (_postgres if connection.dialect.name == "postgresql" else _sqlite)(connection, rows)
    return [k for k in differing if not _same(connection, rows[k])]


def _same(connection: sa.Connection, row: PowerRow) -> bool:
    """Whether the stored row differs by nothing but flags that the sink adds."""
    values = msgspec.structs.asdict(row)
    if connection.dialect.name == "postgresql":
        key = [power.c[name] == getattr(row, name) for name in _KEY]
        stored = dict(connection.execute(sa.select(power).where(*key)).mappings().one())
        values["time"] = datetime.fromisoformat(row.time)
    else:
        stored = numbered_rows.stored_row(connection, row)
        stored["flags"] = orjson.loads(stored["flags"])
    if not added(row.flags) and not added(stored["flags"]):
        return False
    return same_row(stored, values)


def _sqlite(connection: sa.Connection, rows: list[PowerRow]) -> list[int]:
    if conversion.unfinished(connection):
        conversion.move(connection, [(row.device, row.channel, row.boot, row.seq) for row in rows])
    return numbered_rows.insert(connection, rows)


def _postgres(connection: sa.Connection, rows: list[PowerRow]) -> list[int]:
    """COPY straight into the table; by way of a staging table when a row is there already, or a trigger takes rows."""
    values = [_values(one) for one in map(msgspec.structs.astuple, rows)]
    try:
        with connection.begin_nested() as copied:
            if _copy(connection, "power", _QUOTED, values) == len(rows):
                return []
            copied.rollback()  # a trigger drops rows, or puts them elsewhere: what it has put there must not stay
    except sa.exc.DBAPIError as error:
        if not isinstance(error.orig, connection.dialect.loaded_dbapi.errors.UniqueViolation):
            raise
    connection.exec_driver_sql(
        "CREATE TEMP TABLE IF NOT EXISTS arriving (number integer, LIKE power) ON COMMIT DELETE ROWS;"
        "DELETE FROM arriving"  # rows of an earlier part of this transaction
    )
    _copy(connection, "arriving", f"number, {_QUOTED}", [(k, *one) for k, one in enumerate(values)])
    connection.exec_driver_sql(_MOVE)
    return _differing(connection)


def _differing(connection: sa.Connection) -> list[int]:
    values = " OR ".join(f'p."{name}" IS DISTINCT FROM a."{name}"' for name in _COLUMNS if name not in _KEY)
    query = (
        f"SELECT a.number, p.device IS NULL FROM arriving a LEFT JOIN power p ON {_ON_KEY}"
        f" WHERE p.device IS NULL OR {values} ORDER BY a.number"
    )
    found = connection.exec_driver_sql(query).all()
    if missing := sum(absent for _, absent in found):
        raise left_out(connection, missing)
    return [int(number) for number, _ in found]


def _copy(connection: sa.Connection, table: str, columns: str, values: Sequence[tuple[Any, ...]]) -> int:
    """How many rows the server says that it has taken."""
    cursor: Any = connection.connection.cursor()
    lines = _lines(values)
    try:
        with cursor:
            with cursor.copy(f"COPY {table} ({columns}) FROM STDIN ({_TEXT if lines is None else _CSV})") as copy:
                if lines is not None:
                    copy.write(lines)
                for row in values if lines is None else ():
                    copy.write_row(row)
            return int(cursor.rowcount)
    except connection.dialect.loaded_dbapi.Error as error:  # SQLAlchemy does not see it
        raise sa.exc.DBAPIError("COPY", None, error) from error


def _lines(values: Sequence[tuple[Any, ...]]) -> bytes | None:
    """The rows as CSV: what JSON has between the brackets, in a fifth of the time of row by row.

    None where a text holds brackets like those between rows, or a character for which JSON has an escape of its own.
    """
    try:
        found = orjson.dumps(values)[2:-2]
    except orjson.JSONEncodeError:  # half of a pair of surrogates
        return None
    if b"\\" in found and b"\\" in found.replace(b'\\"', b""):
        return None
    lines = found.replace(b"],[", b"\n")
    return lines if len(found) - len(lines) == 2 * (len(values) - 1) else None


def _values(row: tuple[Any, ...]) -> tuple[Any, ...]:
    """As the columns have them."""
    flags = row[_FLAGS]
    return *row[:_FLAGS], orjson.dumps(flags).decode() if flags else "[]", *row[_FLAGS + 1 :]
