"""Batches of messages into SQL: one transaction, idempotent by key, malformed ones into quarantine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import orjson
import sqlalchemy as sa

from acqd.storage.database import transaction
from acqd.storage.schema import power, quarantine
from acqd.telemetry import topics
from acqd.telemetry.row import PowerRow, parse_row
from acqd.timestamps import rfc3339

_COLUMNS = [column.name for column in power.columns]
_QUOTED = ", ".join(f'"{name}"' for name in _COLUMNS)
_SQLITE_INSERT = f"INSERT INTO power ({_QUOTED}) VALUES ({', '.join('?' * len(_COLUMNS))}) ON CONFLICT DO NOTHING"
_PAYLOAD_KEPT = 65_536  # bytes of a malformed message worth keeping


@dataclass(frozen=True, slots=True)
class Received:
    """One message as it came from the broker."""

    topic: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class Written:
    """What became of a batch."""

    rows: int
    """Valid rows, those already known included."""
    quarantined: int


class _PoisonError(Exception):
    """The database will never take this batch as it is."""


class Writer:
    """Writes to one database; not for several threads at once."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine
        self._insert = _insert_postgres if engine.dialect.name == "postgresql" else _insert_sqlite

    def write(self, messages: Sequence[Received]) -> Written:
        """Commit all of `messages`, or nothing. Raises sqlalchemy.exc.DatabaseError."""
        rows: list[PowerRow] = []
        refused: list[dict[str, Any]] = []
        for message in messages:
            try:
                row = parse_row(message.payload)
                expected = topics.power(row.device, row.channel)
                if message.topic != expected:
                    raise ValueError(f"payload is of {expected}, but came by another topic")
                rows.append(row)
            except ValueError as error:
                refused.append(self._refusal(message, str(error)))
        try:
            self._store(rows, refused)
        except self._engine.dialect.loaded_dbapi.Error as error:  # from COPY, which SQLAlchemy does not see
            raise sa.exc.DatabaseError("COPY", None, error) from error
        except _PoisonError as error:
            return self._apart(messages, str(error))
        return Written(len(rows), len(refused))

    def _apart(self, messages: Sequence[Received], reason: str) -> Written:
        """The database refuses some row of this batch for what it holds: find it, keep the others."""
        if len(messages) == 1:
            self._store([], [self._refusal(messages[0], reason)])
            return Written(0, 1)
        half = len(messages) // 2
        first, second = self.write(messages[:half]), self.write(messages[half:])
        return Written(first.rows + second.rows, first.quarantined + second.quarantined)

    def _store(self, rows: list[PowerRow], refused: list[dict[str, Any]]) -> None:
        with transaction(self._engine) as connection:
            try:
                if rows:
                    self._insert(connection, rows)
            except (sa.exc.DataError, self._engine.dialect.loaded_dbapi.DataError) as error:
                raise _PoisonError(str(error).splitlines()[0]) from error
            if refused:
                connection.execute(sa.insert(quarantine), refused)

    def _refusal(self, message: Received, reason: str) -> dict[str, Any]:
        now = datetime.now(UTC)
        return {
            "received": now if self._engine.dialect.name == "postgresql" else rfc3339(int(now.timestamp() * 1e9)),
            "topic": message.topic,
            "payload": message.payload[:_PAYLOAD_KEPT],
            "reason": reason,
        }


def _flags(row: PowerRow) -> str:
    return orjson.dumps(row.flags).decode() if row.flags else "[]"


def _values(row: PowerRow) -> tuple[Any, ...]:
    return (
        row.device, row.channel, row.boot, row.seq, row.time, row.filetime,
        row.Vrms, row.Irms, row.P, row.S, row.PF, row.f, row.W, _flags(row), row.schema,
    )  # fmt: skip


def _insert_sqlite(connection: sa.Connection, rows: list[PowerRow]) -> None:
    connection.exec_driver_sql(_SQLITE_INSERT, [_values(row) for row in rows])


def _insert_postgres(connection: sa.Connection, rows: list[PowerRow]) -> None:
    """COPY straight into the table; only when a row is there already, by way of a staging table."""
    values = [_values(row) for row in rows]
    try:
        with connection.begin_nested():
            _copy(connection, "power", values)
    except connection.dialect.loaded_dbapi.IntegrityError:
        connection.exec_driver_sql("CREATE TEMP TABLE IF NOT EXISTS arriving (LIKE power) ON COMMIT DELETE ROWS")
        _copy(connection, "arriving", values)
        connection.exec_driver_sql(
            f"INSERT INTO power ({_QUOTED}) SELECT {_QUOTED} FROM arriving ON CONFLICT DO NOTHING"
        )


def _copy(connection: sa.Connection, table: str, values: list[tuple[Any, ...]]) -> None:
    cursor: Any = connection.connection.cursor()
    with cursor, cursor.copy(f"COPY {table} ({_QUOTED}) FROM STDIN") as copy:
        for row in values:
            copy.write_row(row)
