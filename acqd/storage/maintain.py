"""Roll-ups and retention, as one idempotent command."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.database import transaction
from acqd.storage.schema import ROLLUPS, power, power_1min, power_quality, power_register, quarantine
from acqd.timestamps import filetime, rfc3339

_TICKS = 10_000_000  # FILETIME ticks per second
_DAY = 86_400
_LATE_ROWS_S = _DAY  # how far back late rows still change a roll-up


@dataclass(frozen=True, slots=True)
class Retention:
    """Days to keep; 0 keeps for ever."""

    power_days: float = 30.0
    rollup_1min_days: float = 365.0
    quarantine_days: float = 30.0


@dataclass(frozen=True, slots=True)
class Maintained:
    """What one run did."""

    rollup_1min: int
    rollup_15min: int
    power_deleted: int
    rollup_deleted: int
    quarantine_deleted: int


def maintain(engine: sa.Engine, retention: Retention, now: float | None = None) -> Maintained:
    """Roll up every completed bucket not yet rolled up, then delete what is past its retention.

    Buckets of the last day are computed again, for rows that arrived late. `now` is Unix seconds.
    Everything happens in one transaction: no row is deleted before its roll-up is made.
    """
    now = time.time() if now is None else now
    with transaction(engine) as connection:
        # Whole quarter hours only: a half-deleted bucket would be rolled up again, wrongly.
        cut = _cut(now, retention.power_days) // 900 * 900
        minutes, quarters = (_roll_up(connection, seconds, now, int(cut)) for seconds in ROLLUPS)
        power_deleted = _delete(connection, power, power.c.filetime < _ticks(cut)) if cut else 0
        power_deleted += _delete_quality(connection, cut, ("10/12", "150/180", "10s"))
        cut = _cut(now, retention.rollup_1min_days)
        rollup_deleted = _delete(connection, power_1min, power_1min.c.start < cut) if cut else 0
        rollup_deleted += _delete_quality(connection, cut, ("10min", "2h"))
        rollup_deleted += _delete(connection, power_register, power_register.c.filetime < _ticks(cut)) if cut else 0
        cut = _cut(now, retention.quarantine_days)
        quarantine_deleted = _delete(connection, quarantine, _received_before(engine, cut)) if cut else 0
    return Maintained(minutes, quarters, power_deleted, rollup_deleted, quarantine_deleted)


def _delete_quality(connection: sa.Connection, cut: float, aggregations: tuple[str, ...]) -> int:
    """Rows of power quality: short aggregations are kept as rows are, long ones as one-minute roll-ups are."""
    c = power_quality.c
    old = sa.and_(c.filetime < _ticks(cut), c.aggregation.in_(aggregations))
    return _delete(connection, power_quality, old) if cut else 0


def _cut(now: float, days: float) -> float:
    return now - days * _DAY if days else 0.0


def _ticks(unix: float) -> int:
    return filetime(int(unix) * 1_000_000_000)


def _received_before(engine: sa.Engine, unix: float) -> sa.ColumnElement[bool]:
    text = rfc3339(int(unix) * 1_000_000_000)
    if engine.dialect.name == "postgresql":
        return quarantine.c.received < sa.cast(sa.literal(text, sa.Text), sa.DateTime(timezone=True))
    return quarantine.c.received < text


def _delete(connection: sa.Connection, table: sa.Table, condition: sa.ColumnElement[bool]) -> int:
    return connection.execute(sa.delete(table).where(condition)).rowcount


def _roll_up(connection: sa.Connection, seconds: int, now: float, cut: int) -> int:
    """Roll up the buckets of `seconds` that are complete at `now`; `cut`: older rows are about to go.

    Recent buckets are computed again, for rows that came late. Rows that came even later (a backlog of
    days) are rolled up just before they are deleted, unless their bucket exists.
    """
    table = ROLLUPS[seconds]
    newest = connection.execute(sa.select(sa.func.max(table.c.start))).scalar()
    begin = 0 if newest is None else int(newest) // seconds * seconds - _LATE_ROWS_S
    end = int(now) // seconds * seconds
    made = _write_buckets(connection, seconds, begin, end, replace=True)
    return made + (_write_buckets(connection, seconds, 0, min(cut, begin), replace=False) if cut else 0)


def _square(column: sa.ColumnElement[Any]) -> sa.ColumnElement[Any]:
    """x * x; 0 for what is too small to be squared (PostgreSQL calls that an error)."""
    return sa.case((sa.func.abs(column) < 1e-100, 0.0), else_=column * column)


def _write_buckets(connection: sa.Connection, seconds: int, begin: int, end: int, *, replace: bool) -> int:
    """Buckets between the Unix times `begin` and `end`; an existing one is replaced or left."""
    table = ROLLUPS[seconds]
    c = power.c
    start = (c.filetime - filetime(0)) // (_TICKS * seconds) * seconds
    P, S = sa.func.avg(c.P), sa.func.avg(c.S)
    last = sa.func.max(c.filetime)
    at_end = power.alias("at_end")
    reading = (
        sa.select(sa.func.max(at_end.c.W))
        .where(at_end.c.device == c.device, at_end.c.channel == c.channel, at_end.c.filetime == last)
        .scalar_subquery()
    )
    columns: dict[str, Any] = {
        "device": c.device,
        "channel": c.channel,
        "start": start,
        "rows": sa.func.count(),
        "Vrms": sa.func.sqrt(sa.func.avg(_square(c.Vrms))),
        "Vrms_min": sa.func.min(c.Vrms),
        "Vrms_max": sa.func.max(c.Vrms),
        "Irms": sa.func.sqrt(sa.func.avg(_square(c.Irms))),
        "Irms_max": sa.func.max(c.Irms),
        "P": P,
        "P_min": sa.func.min(c.P),
        "P_max": sa.func.max(c.P),
        "S": S,
        "PF": P / sa.func.nullif(S, 0.0),
        "f": sa.func.avg(c.f),
        "W": reading,
        "flagged": sa.func.sum(sa.case((sa.cast(c.flags, sa.Text) != "[]", 1), else_=0)),
    }
    query = (
        sa.select(*(value.label(name) for name, value in columns.items()))
        .where(c.filetime >= _ticks(begin), c.filetime < _ticks(end))
        .group_by(c.device, c.channel, sa.text("start"))
    )
    insert: Any = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
    statement = insert(table).from_select(list(columns), query)
    key = ["device", "channel", "start"]
    changed = {name: statement.excluded[name] for name in columns if name not in key}
    upsert = (
        statement.on_conflict_do_update(index_elements=key, set_=changed)
        if replace
        else statement.on_conflict_do_nothing(index_elements=key)
    )
    return int(connection.execute(upsert.execution_options(preserve_rowcount=True)).rowcount)
