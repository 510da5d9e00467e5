"""What a sink writes down in its database about the database: identity, number of the last commit, clocks then."""

from __future__ import annotations

from typing import NamedTuple

import orjson
import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.away import left_out
from acqd.storage.schema import database_state
from acqd.uptime import Moment

_COMMITS, _RECALLED, _RUN = "commits/", "recalled/", "run/"
_MOST = 2**62
"""Of numbers and nanoseconds: what somebody else has written there is not counted on."""
IDENTITY, MAINTAINED, SIZE = "identity", "maintained", "size"


def _write_in(insert: postgresql.Insert | sqlite.Insert) -> sa.Insert:
    written = insert.on_conflict_do_update(index_elements=["key"], set_={"value": insert.excluded.value})
    return written.execution_options(preserve_rowcount=True)


# Made once: they stand in every transaction of a sink.
_READ = sa.select(database_state.c.value).where(database_state.c.key == sa.bindparam("key"))
_AT_ONCE = ("one", "two", "three")
_READ_SOME = sa.select(database_state.c.key, database_state.c.value).where(
    sa.or_(*(database_state.c.key == sa.bindparam(name) for name in _AT_ONCE))
)
_WRITE = {
    "postgresql": _write_in(postgresql.insert(database_state)),
    "sqlite": _write_in(sqlite.insert(database_state)),
}


def commits(client_id: str) -> str:
    """Key of the commits of one sink: several sinks of a group do not wait for one another."""
    return f"{_COMMITS}{client_id}"


def recalled(client_id: str) -> str:
    """Key of the name of the last event by which one sink's database lacked rows."""
    return f"{_RECALLED}{client_id}"


def run(client_id: str) -> str:
    """Key of the name of the run of one sink that made the last commit: another history has another one (ADR 97)."""
    return f"{_RUN}{client_id}"


def has_commits(connection: sa.Connection) -> bool:
    """Whether a sink has ever committed rows there."""
    key = database_state.c.key
    return connection.execute(sa.select(sa.exists().where(key.startswith(_COMMITS, autoescape=True)))).scalar_one()


class Mark(NamedTuple):
    """A commit, or a run of the maintenance, and the clocks then."""

    number: int
    wall_ns: int
    """UTC by the clock of the sink's computer, or later, where that clock has been set back."""
    moment: Moment

    def estimate_ns(self, now: Moment) -> int:
        """UTC at `now`, if the clock was right then; the least of it, where the computer has been off since [ns]."""
        return self.wall_ns + round(self.moment.age_s(now) * 1e9)


def read(connection: sa.Connection, key: str) -> str | None:
    """A value. Raises the errors of SQLAlchemy, where the table is missing too."""
    value = connection.execute(_READ, {"key": key}).scalar()
    return None if value is None else str(value)


def read_some(connection: sa.Connection, *keys: str) -> dict[str, str]:
    """The values of three keys as far as they are there, by one question. Raises as `read`."""
    found = connection.execute(_READ_SOME, dict(zip(_AT_ONCE, keys, strict=True)))
    return {str(key): str(value) for key, value in found}


def write(connection: sa.Connection, key: str, value: str) -> None:
    """Set a value. Raises DatabaseAwayError where the database drops it without an error."""
    if not connection.execute(_WRITE[connection.dialect.name], {"key": key, "value": value}).rowcount:
        raise left_out(connection, 1)  # a number that stays behind would look like a database that was put back


def read_mark(connection: sa.Connection, key: str) -> Mark | None:
    """A mark; None where there is none, or none that can be understood."""
    return mark_of(read(connection, key))


def mark_of(text: str | None) -> Mark | None:
    """The mark in a value, as `read_mark`."""
    try:
        number, wall_ns, start, ns = orjson.loads(text or "null")
        mark = Mark(int(number), int(wall_ns), Moment(bytes.fromhex(start), int(ns)))
    except (TypeError, ValueError, OverflowError):
        return None
    return mark if all(0 <= one < _MOST for one in (mark.number, mark.wall_ns, mark.moment.ns)) else None


def write_mark(connection: sa.Connection, key: str, mark: Mark) -> None:
    """Set a mark."""
    content = [mark.number, mark.wall_ns, mark.moment.start.hex(), mark.moment.ns]
    write(connection, key, orjson.dumps(content).decode())
