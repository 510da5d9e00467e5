"""Moves rows of an earlier acqd into the layout of this one, in SQLite: in short transactions, for as long as it takes.

Whatever ends it, the next start goes on. Rows that come meanwhile are stored in the new layout; one whose key is still
in the old table is moved first, so that it is compared as ever.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import orjson
import sqlalchemy as sa

from acqd.storage import numbered_rows
from acqd.storage.migrations.versions.m0010_numbered_rows import COLUMNS, views
from acqd.telemetry.row import PowerRow

_QUOTED = ", ".join(f'"{name}"' for name in COLUMNS)
_AT_ONCE = 10_000


def unfinished(connection: sa.Connection) -> bool:
    """Whether there are rows to move."""
    query = "SELECT 1 FROM sqlite_master WHERE name = 'power_before'"
    return connection.dialect.name == "sqlite" and connection.exec_driver_sql(query).scalar() is not None


def convert(engine: sa.Engine, most: int | None = None) -> int:
    """Move all rows, or about `most`; how many. Raises the errors of SQLAlchemy."""
    moved = 0
    if engine.dialect.name != "sqlite":
        return moved
    while most is None or moved < most:
        with engine.begin() as connection:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            if not unfinished(connection):
                return moved
            query = f"SELECT rowid, {_QUOTED} FROM power_before ORDER BY rowid LIMIT {_AT_ONCE}"
            found = connection.exec_driver_sql(query).all()
            if not found:
                for statement in ("DROP VIEW power", "DROP TABLE power_before", *views(before=False)):
                    connection.exec_driver_sql(statement)
                return moved
            numbered_rows.insert(connection, [_row(row[1:]) for row in found])
            connection.exec_driver_sql("DELETE FROM power_before WHERE rowid <= ?", (found[-1][0],))
            moved += len(found)
    return moved


def move(connection: sa.Connection, keys: Iterable[Sequence[object]]) -> None:
    """Move the rows with these keys (device, channel, boot, seq)."""
    where = "device = ? AND channel = ? AND boot = ? AND seq = ?"
    for key in keys:
        row = connection.exec_driver_sql(f"SELECT {_QUOTED} FROM power_before WHERE {where}", tuple(key)).one_or_none()
        if row is not None:
            numbered_rows.insert(connection, [_row(row)])
            connection.exec_driver_sql(f"DELETE FROM power_before WHERE {where}", tuple(key))


def _row(values: Sequence[Any]) -> PowerRow:
    row = PowerRow(*values)
    row.flags = orjson.loads(values[-2])
    return row
