"""Roll-ups and retention, as one idempotent command, in many short transactions: rows are stored in between."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.away import left_out
from acqd.storage.clock_witness import IMPOSSIBLE
from acqd.storage.conversion import convert
from acqd.storage.database import transaction
from acqd.storage.schema import ROLLUPS, power, power_1min, power_quality, power_register, power_row, quarantine
from acqd.timestamps import filetime, rfc3339, unix_s

_TICKS = 10_000_000  # FILETIME ticks per second
_DAY = 86_400
_LATE_ROWS_S = _DAY  # how far back late rows still change a roll-up
_SPAN_S = 900  # of one transaction: whole buckets


@dataclass(frozen=True, slots=True)
class Retention:
    """Days to keep; 0 keeps for ever."""

    power_days: float = 30.0
    rollup_1min_days: float = 365.0
    quarantine_days: float = 30.0
    fits_disk: bool = False
    """`power_days` are the most; fewer where the disk of an SQLite database has no room for them (acqd.storage.room).
    """


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

    Buckets of the last day are computed again, for rows that arrived late. `now` is Unix seconds, and believed: see
    `retention_doubt`. No row is deleted before its roll-up is made; a run that is interrupted is continued by the next.
    """
    now = time.time() if now is None else now
    convert(engine)
    rows = power if engine.dialect.name == "postgresql" else power_row
    # Whole quarter hours only: a half-deleted bucket would be rolled up again, wrongly.
    cut = power_cut(retention, now)
    minutes, quarters = (_roll_up(engine, seconds, now, int(cut)) for seconds in ROLLUPS)
    power_deleted = _delete(engine, rows, rows.c.filetime, cut)
    power_deleted += _delete_quality(engine, cut, ("10/12", "150/180", "10s"))
    if power_deleted and rows is power_row:
        _forget_names(engine)
    cut = _cut(now, retention.rollup_1min_days)
    rollup_deleted = _delete_where(engine, power_1min, power_1min.c.start < cut) if cut else 0
    rollup_deleted += _delete_quality(engine, cut, ("10min", "2h"))
    rollup_deleted += _delete(engine, power_register, power_register.c.filetime, cut)
    cut = _cut(now, retention.quarantine_days)
    malformed = ~quarantine.c.reason.startswith(IMPOSSIBLE)  # rows that can be restored stay until a person decides
    old = sa.and_(_received_before(engine, cut), malformed)
    quarantine_deleted = _delete_where(engine, quarantine, old) if cut else 0
    return Maintained(minutes, quarters, power_deleted, rollup_deleted, quarantine_deleted)


def _forget_names(engine: sa.Engine) -> None:
    """Runs and times of rows that are gone; SQLite."""
    with transaction(engine) as connection:
        connection.exec_driver_sql(
            "DELETE FROM power_run WHERE NOT EXISTS (SELECT 1 FROM power_row v"
            " WHERE v.id >= power_run.id << 34 AND v.id < (power_run.id + 1) << 34)"
        )
        connection.exec_driver_sql("DELETE FROM power_stamp WHERE id NOT IN (SELECT id FROM power_row)")


def power_cut(retention: Retention, now: float) -> float:
    """Rows from before this time go [Unix s]; 0: none."""
    return _cut(now, retention.power_days) // 900 * 900


def _delete_quality(engine: sa.Engine, cut: float, aggregations: tuple[str, ...]) -> int:
    """Rows of power quality: short aggregations are kept as rows are, long ones as one-minute roll-ups are."""
    c = power_quality.c
    return _delete(engine, power_quality, c.filetime, cut, c.aggregation.in_(aggregations))


def _cut(now: float, days: float) -> float:
    return now - days * _DAY if days else 0.0


def _ticks(unix: float) -> int:
    return filetime(int(unix) * 1_000_000_000)


def _received_before(engine: sa.Engine, unix: float) -> sa.ColumnElement[bool]:
    text = rfc3339(int(unix) * 1_000_000_000)
    if engine.dialect.name == "postgresql":
        return quarantine.c.received < sa.cast(sa.literal(text, sa.Text), sa.DateTime(timezone=True))
    return quarantine.c.received < text


def _delete(
    engine: sa.Engine, table: sa.Table, time: sa.Column[Any], cut: float, also: sa.ColumnElement[bool] | None = None
) -> int:
    """Rows from before `cut`, oldest first, a span of time in each transaction."""
    condition = sa.true() if also is None else also
    deleted = 0
    for begin, end in _spans(engine, time, condition, 0, int(cut)):
        deleted += _delete_where(engine, table, sa.and_(time >= _ticks(begin), time < _ticks(end), condition))
    return deleted


def _delete_where(engine: sa.Engine, table: sa.Table, condition: sa.ColumnElement[bool]) -> int:
    with transaction(engine) as connection:
        return connection.execute(sa.delete(table).where(condition)).rowcount


def _spans(
    engine: sa.Engine, time: sa.Column[Any], condition: sa.ColumnElement[bool], begin: int, end: int
) -> Iterator[tuple[int, int]]:
    """Spans of time [Unix s] between `begin` and `end` in which there are rows."""
    while begin < end:
        query = sa.select(sa.func.min(time)).where(condition, time >= _ticks(begin))
        with engine.connect() as connection:
            first = connection.execute(query).scalar()
        if first is None or int(first) >= _ticks(end):
            return
        start = max(begin, int(unix_s(int(first))) // _SPAN_S * _SPAN_S)
        begin = min(start + _SPAN_S, end)
        yield start, begin


def _roll_up(engine: sa.Engine, seconds: int, now: float, cut: int) -> int:
    """Roll up the buckets of `seconds` that are complete at `now`; `cut`: older rows are about to go.

    Recent buckets are computed again, for rows that came late. Rows that came even later (a backlog of
    days) are rolled up just before they are deleted, unless their bucket exists.
    """
    table = ROLLUPS[seconds]
    with engine.connect() as connection:
        newest = connection.execute(sa.select(sa.func.max(table.c.start))).scalar()
    begin = 0 if newest is None else int(newest) // seconds * seconds - _LATE_ROWS_S
    end = int(now) // seconds * seconds
    return _write_spans(engine, seconds, begin, end, replace=True) + (
        _write_spans(engine, seconds, 0, min(cut, begin), replace=False) if cut else 0
    )


def _write_spans(engine: sa.Engine, seconds: int, begin: int, end: int, *, replace: bool) -> int:
    made = 0
    rows = power if engine.dialect.name == "postgresql" else power_row
    for first, last in _spans(engine, rows.c.filetime, sa.true(), max(begin, 0), end):
        with transaction(engine) as connection:
            some = _write_buckets(connection, seconds, first, last, replace=replace)
            within = (rows.c.filetime >= _ticks(first), rows.c.filetime < _ticks(last))
            if replace and not some and connection.scalar(sa.select(rows.c.filetime).where(*within).limit(1)):
                raise left_out(connection)  # rows are there, and would be deleted without their roll-up
        made += some
    return made


def _square(column: sa.ColumnElement[Any]) -> sa.ColumnElement[Any]:
    """x * x; 0 for what is too small to be squared (PostgreSQL calls that an error)."""
    return sa.case((sa.func.abs(column) < 1e-100, 0.0), else_=column * column)


def _no_index(connection: sa.Connection, column: sa.Column[Any]) -> sa.ColumnElement[Any]:
    """SQLite would read all rows of a channel for each bucket by the primary key; the index on time holds a few."""
    return column.op("||")("") if connection.dialect.name == "sqlite" else column


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
        .where(_no_index(connection, at_end.c.device) == c.device, at_end.c.channel == c.channel)
        .where(at_end.c.filetime == last)
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
