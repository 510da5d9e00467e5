"""Which rows of a day are in the database, and why others are not.

Windows are numbered (boot, seq), so the database itself shows what is missing: a jump of seq whose next row is flagged
`gap` was never metered; a jump without that flag was metered and did not arrive.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from typing import Any, Literal

import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage.gaps import TICKS, Gap, Span, gaps_of
from acqd.storage.schema import power, power_1min
from acqd.timestamps import filetime

__all__ = ["Completeness", "completeness", "day_of"]
_ON_THEIR_WAY = timedelta(seconds=5)  # rows younger than this need not be stored
_NOMINAL_TICKS = TICKS * 40 // 1000


@dataclass(frozen=True, slots=True)
class Completeness:
    """One channel of one device over one day (UTC)."""

    device: str
    channel: str
    day: str
    expected: int
    """Rows stored and missing, from the begin of the day (or the first row ever) to its end (or now)."""
    stored: int
    interval_s: float
    """Between two rows."""
    gaps: list[Gap]
    source: Literal["rows", "roll-ups"]
    """`roll-ups`: the rows are past their retention; the gaps are not known any more."""

    @property
    def missing(self) -> int:
        """Rows that are not stored."""
        return max(0, self.expected - self.stored)


def day_of(text: str, now: datetime) -> date:
    """YYYY-MM-DD, `today` or `yesterday` (UTC). Raises UserError."""
    words = {"today": now.date(), "yesterday": now.date() - timedelta(days=1)}
    if text in words:
        return words[text]
    try:
        day = date.fromisoformat(text)
    except ValueError:
        raise UserError(f"--day {text!r}: expected YYYY-MM-DD, today or yesterday (UTC)") from None
    if day > now.date():
        raise UserError(f"--day {text}: this day has not begun (UTC)")
    return day


def completeness(engine: sa.Engine, day: date, now: datetime, device: str | None = None) -> list[Completeness]:
    """Every device and channel that has rows on `day` or before."""
    begin = datetime(day.year, day.month, day.day, tzinfo=UTC)
    end = min(begin + timedelta(days=1), now - _ON_THEIR_WAY)
    with engine.connect() as connection:
        known = _streams(connection, _ticks(end), device)
        return [_one(connection, *stream, begin, end) for stream in known]


def _streams(connection: sa.Connection, end: int, device: str | None) -> list[tuple[str, str, int]]:
    """Device, channel and first row (ticks) of all that have rows, or roll-ups, before `end`."""
    c, m = power.c, power_1min.c
    rows = sa.select(c.device, c.channel, sa.func.min(c.filetime)).where(c.filetime < end)
    buckets = sa.select(m.device, m.channel, sa.func.min(m.start) * TICKS + filetime(0)).where(
        m.start < (end - filetime(0)) // TICKS
    )
    if device is not None:
        rows, buckets = rows.where(c.device == device), buckets.where(m.device == device)
    first: dict[tuple[str, str], int] = {}
    for query in (rows.group_by(c.device, c.channel), buckets.group_by(m.device, m.channel)):
        for name, channel, ticks in connection.execute(query):
            first[name, channel] = min(int(ticks), first.get((name, channel), int(ticks)))
    return [(name, channel, ticks) for (name, channel), ticks in sorted(first.items())]


def _one(
    connection: sa.Connection, device: str, channel: str, first: int, begin: datetime, end: datetime
) -> Completeness:
    span = Span(max(_ticks(begin), first), _ticks(end))
    in_day = sa.and_(
        power.c.device == device, power.c.channel == channel,
        power.c.filetime >= span.begin, power.c.filetime < span.end,
    )  # fmt: skip
    stored = int(connection.execute(sa.select(sa.func.count()).where(in_day)).scalar_one())
    bucket_rows = 0 if stored else _rolled_up(connection, device, channel, begin, end)
    interval = _interval(connection, in_day) if stored else _NOMINAL_TICKS
    rolled = bucket_rows > 0
    gaps = [] if rolled else gaps_of(_breaks(connection, in_day, interval), span, interval)
    room = max(0, round((span.end - span.begin) / interval))
    return Completeness(
        device, channel, begin.date().isoformat(),
        expected=room if rolled else stored + sum(gap.rows for gap in gaps),
        stored=bucket_rows if rolled else stored,
        interval_s=interval / TICKS,
        gaps=gaps,
        source="roll-ups" if rolled else "rows",
    )  # fmt: skip


def _rolled_up(connection: sa.Connection, device: str, channel: str, begin: datetime, end: datetime) -> int:
    m = power_1min.c
    query = sa.select(sa.func.sum(m.rows)).where(
        m.device == device, m.channel == channel, m.start >= int(begin.timestamp()), m.start < int(end.timestamp())
    )
    return int(connection.execute(query).scalar() or 0)


def _with_previous(in_day: sa.ColumnElement[bool]) -> sa.Subquery:
    """The day's rows beside their predecessor of the same boot."""
    c = power.c
    order: dict[str, Any] = {"partition_by": c.boot, "order_by": c.seq}
    return (
        sa.select(
            c.boot, c.seq, c.filetime, sa.cast(c.flags, sa.Text).label("flags"),
            sa.func.lag(c.seq).over(**order).label("seq_before"),
            sa.func.lag(c.filetime).over(**order).label("filetime_before"),
            sa.func.lead(c.seq).over(**order).label("seq_after"),
        )
        .where(in_day)
        .subquery()
    )  # fmt: skip


def _interval(connection: sa.Connection, in_day: sa.ColumnElement[bool]) -> int:
    """The most frequent time between two consecutive rows, to the millisecond [ticks]."""
    rows = _with_previous(in_day)
    milliseconds = (rows.c.filetime - rows.c.filetime_before + 5_000) / 10_000
    between = sa.cast(sa.func.floor(milliseconds), sa.Integer).label("between")
    query = (
        sa.select(between).where(rows.c.seq == rows.c.seq_before + 1).group_by(between).order_by(sa.func.count().desc())
    )
    found = connection.execute(query.limit(1)).scalar()
    return int(found) * 10_000 if found else _NOMINAL_TICKS


def _breaks(connection: sa.Connection, in_day: sa.ColumnElement[bool], interval: int) -> Iterable[Any]:
    """First and last row of each boot, and rows that do not follow their predecessor; in the order of time."""
    rows = _with_previous(in_day)
    r = rows.c
    jump = sa.or_(
        r.seq_before.is_(None), r.seq_after.is_(None), r.seq != r.seq_before + 1,
        sa.func.abs(r.filetime - r.filetime_before - interval) > interval,
    )  # fmt: skip
    return connection.execute(sa.select(rows).where(jump).order_by(r.filetime, r.seq)).all()


def _ticks(moment: datetime) -> int:
    return filetime(round(moment.timestamp() * 1000) * 1_000_000)
