"""Rows of power quality and of registers into their tables: what is new; of the others, which ones differ.

Keys are looked up before rows are inserted: where a trigger puts rows into a table that inherits, no key is there for
ON CONFLICT, and a row that comes twice would be stored twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any, TypeAlias

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.away import left_out
from acqd.storage.schema import power_quality, power_register
from acqd.storage.sink_flags import same_row
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.register_row import RegisterRow

KeyedRow: TypeAlias = QualityRow | RegisterRow
TABLES: dict[type[KeyedRow], sa.Table] = {QualityRow: power_quality, RegisterRow: power_register}
_KEY = ("device", "channel", "boot", "seq")
_AT_ONCE = 500
"""Keys of one query: four parameters each."""


def insert(connection: sa.Connection, table: sa.Table, rows: Sequence[KeyedRow]) -> list[int]:
    """Insert what is new; positions in `rows` of those whose key is stored with other values.

    Raises the errors of SQLAlchemy; DatabaseAwayError where the database drops rows without an error.
    """
    if not rows:
        return []
    postgres = connection.dialect.name == "postgresql"
    values = [_values(row, postgres) for row in rows]
    stored = {_key(one): one for one in _stored(connection, table, values)}
    fresh: dict[tuple[Any, ...], dict[str, Any]] = {}
    for one in values:
        if _key(one) not in stored:
            fresh.setdefault(_key(one), one)
    if fresh and _inserted(connection, table, list(fresh.values()), postgres) < len(fresh):
        fresh = {_key(one): one for one in _stored(connection, table, list(fresh.values()))}
    stored |= fresh
    if missing := sum(_key(one) not in stored for one in values):
        raise left_out(connection, missing)
    return [k for k, one in enumerate(values) if not same_row(one, stored[_key(one)])]


def _inserted(connection: sa.Connection, table: sa.Table, values: Sequence[dict[str, Any]], postgres: bool) -> int:
    """How many were new; psycopg counts the rows of a batch only where they are returned."""
    if postgres:
        statement = postgresql.insert(table).on_conflict_do_nothing().returning(table.c.seq)
        return len(connection.execute(statement, values).all())
    return connection.execute(sqlite.insert(table).on_conflict_do_nothing(), values).rowcount


def _stored(connection: sa.Connection, table: sa.Table, values: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The rows that the table holds under the keys of `values`."""
    keys, columns = list(dict.fromkeys(map(_key, values))), [table.c[name] for name in _KEY]
    for begin in range(0, len(keys), _AT_ONCE):
        query = sa.select(table).where(sa.tuple_(*columns).in_(keys[begin : begin + _AT_ONCE]))
        yield from (dict(one) for one in connection.execute(query).mappings())


def _key(values: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(values[name] for name in _KEY)


def _values(row: KeyedRow, postgres: bool) -> dict[str, Any]:
    values = asdict(row)
    return values | {"time": datetime.fromisoformat(row.time)} if postgres else values
