"""Which rows of a day are in the database, and why others are not.

Windows are numbered (boot, seq), so the database itself shows what is missing: a jump of seq whose next row is flagged
`gap` was never metered; a jump without that flag was metered and did not arrive. The rows of the day are read once, in
the order of the index on `filetime`: memory stays small, however many there are.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from typing import Literal

import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage.gaps import TICKS, Break, Gap, Span, gaps_of
from acqd.storage.schema import power, power_1min
from acqd.timestamps import filetime, unix_s

_ON_THEIR_WAY = timedelta(seconds=5)  # rows younger than this need not be stored
_NOMINAL_TICKS = TICKS * 40 // 1000
_SAMPLE = 2_000  # distances between rows that tell the interval
_PORTION = 20_000
_Key = tuple[str, str]  # device, channel
_Row = tuple[str, str, str, int, int, str]  # device, channel, boot, seq, filetime, flags


_MOST_DAYS = timedelta(days=366)


@dataclass(frozen=True, slots=True)
class Completeness:
    """One channel of one device over one day (UTC)."""

    device: str
    channel: str
    day: str
    expected: int
    """Rows stored and missing, from the start of the day (or the first row ever) to its end (or now)."""
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


@dataclass(slots=True)
class _Stream:
    """What is seen of a channel while its rows pass by."""

    stored: int = 0
    last: dict[str, Break] = field(default_factory=dict)  # by boot: the newest row
    breaks: list[Break] = field(default_factory=list)
    distances: Counter[int] = field(default_factory=Counter)  # ms between consecutive rows
    interval: int = _NOMINAL_TICKS  # of the first two rows

    def add(self, row: _Row) -> None:
        """Take the next row in the order of time."""
        _, _, boot, seq, ticks, flags = row
        before = self.last.get(boot)
        this = Break(boot, seq, ticks, flags)
        self.last[boot] = this
        self.stored += 1
        if before is None:
            self.breaks.append(this)
            return
        distance = ticks - before.filetime
        if seq == before.seq + 1:
            if self.stored < _SAMPLE:
                self.interval = distance if not self.distances else self.interval
                self.distances[(distance + 5_000) // 10_000] += 1
            if abs(distance - self.interval) < self.interval:
                return
        this.seq_before, this.filetime_before = before.seq, before.filetime
        self.breaks.append(this)

    def in_order(self) -> list[Break]:
        """Begin and end of each boot and what does not follow its predecessor."""
        for row in self.last.values():
            row.ends = True
        ends = [row for row in self.last.values() if not any(row is other for other in self.breaks)]
        for row in ends:
            row.seq_before, row.filetime_before = row.seq - 1, row.filetime - self.usual
        return sorted([*self.breaks, *ends], key=lambda row: (row.filetime, row.seq))

    @property
    def usual(self) -> int:
        """The most frequent distance between two rows [ticks]."""
        return max(self.distances.most_common(1)[0][0], 1) * 10_000 if self.distances else _NOMINAL_TICKS


def days_between(day: str | None, first: str | None, to: str | None, now: datetime) -> list[date]:
    """One day (yesterday, if nothing is given), or those from `first` until the one before `to`. Raises UserError."""
    if first is None and to is None:
        return [day_of(day or "yesterday", now)]
    if day is not None or first is None:
        raise UserError("--day is for one day, --from and --to are for several: give --day, or --from")
    begin, end = day_of(first, now, "--from"), now.date() if to is None else day_of(to, now, "--to")
    if not timedelta(0) < end - begin <= _MOST_DAYS:
        raise UserError(f"--from {first}: expected a day before {end}, and {_MOST_DAYS.days} days at most")
    return [begin + timedelta(days=number) for number in range((end - begin).days)]


def day_of(text: str, now: datetime, option: str = "--day") -> date:
    """YYYY-MM-DD, `today` or `yesterday` (UTC). Raises UserError, which names `option`."""
    words = {"today": now.date(), "yesterday": now.date() - timedelta(days=1)}
    if text in words:
        return words[text]
    try:
        day = date.fromisoformat(text)
    except ValueError:
        raise UserError(f"{option} {text!r}: expected YYYY-MM-DD, today or yesterday (UTC)") from None
    if day > now.date():
        raise UserError(f"{option} {text}: this day has not begun (UTC)")
    return day


def completeness(
    engine: sa.Engine,
    day: date,
    now: datetime,
    device: str | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> list[Completeness]:
    """Every device and channel that has rows on `day` or the day before, or roll-ups; `progress` takes 0 to 1."""
    begin = datetime(day.year, day.month, day.day, tzinfo=UTC)
    end = max(begin, min(begin + timedelta(days=1), now - _ON_THEIR_WAY))
    with engine.connect() as connection:
        first, rolled = _known(connection, begin, end)
        streams: dict[_Key, _Stream] = {}
        span = Span(_ticks(begin), _ticks(end))
        for row in _rows(connection, span):
            stream = streams.get(row[:2])
            if stream is None:
                stream = streams[row[:2]] = _Stream()
            stream.add(row)
            if not stream.stored % _PORTION:
                progress((row[4] - span.begin) / (span.end - span.begin))
    for key, stream in streams.items():
        oldest = stream.breaks[0].filetime
        if oldest - first.setdefault(key, oldest) < TICKS * 60 and first[key] >= span.begin:
            first[key] = oldest  # of the first roll-up ever, the minute is known
    keys = sorted(key for key in first if device is None or key[0] == device)
    return [
        _report(key, begin, Span(max(span.begin, first[key]), span.end), streams.get(key), rolled.get(key, 0))
        for key in keys
    ]


def first_day(engine: sa.Engine) -> date | None:
    """Day (UTC) of the oldest row; None without rows."""
    with engine.connect() as connection:
        oldest = connection.scalar(sa.select(sa.func.min(power.c.filetime)))
    return None if oldest is None else datetime.fromtimestamp(unix_s(oldest), UTC).date()


def _report(key: _Key, day: datetime, span: Span, stream: _Stream | None, rolled: int) -> Completeness:
    name = day.date().isoformat()
    if stream is None and rolled:
        expected = max(0, round((span.end - span.begin) / _NOMINAL_TICKS))
        return Completeness(*key, name, expected, rolled, _NOMINAL_TICKS / TICKS, [], "roll-ups")
    stream = stream or _Stream()
    gaps = gaps_of(stream.in_order(), span, stream.usual)
    expected = stream.stored + sum(gap.rows for gap in gaps)
    return Completeness(*key, name, expected, stream.stored, stream.usual / TICKS, gaps, "rows")


def _known(connection: sa.Connection, begin: datetime, end: datetime) -> tuple[dict[_Key, int], dict[_Key, int]]:
    """First row (ticks), and rows that the roll-ups count within the day, by device and channel."""
    c, m = power.c, power_1min.c
    day = sa.and_(m.start >= int(begin.timestamp()), m.start < int(end.timestamp()))
    counted = sa.func.sum(sa.case((day, m.rows), else_=0))
    buckets = sa.select(m.device, m.channel, sa.func.min(m.start), counted).where(m.start < int(end.timestamp()))
    first: dict[_Key, int] = {}
    rolled: dict[_Key, int] = {}
    for name, channel, start, rows in connection.execute(buckets.group_by(m.device, m.channel)):
        first[name, channel], rolled[name, channel] = filetime(int(start) * 10**9), int(rows)
    before = sa.and_(c.filetime >= _ticks(begin - timedelta(days=1)), c.filetime < _ticks(begin))
    query = sa.select(c.device, c.channel, sa.func.min(c.filetime)).where(before).group_by(c.device, c.channel)
    for name, channel, ticks in connection.execute(query):
        first[name, channel] = min(int(ticks), first.get((name, channel), int(ticks)))
    return first, rolled


def _rows(connection: sa.Connection, span: Span) -> Iterator[_Row]:
    c = power.c
    query = (
        sa.select(c.device, c.channel, c.boot, c.seq, c.filetime, sa.cast(c.flags, sa.Text))
        .where(c.filetime >= span.begin, c.filetime < span.end)
        .order_by(c.filetime)
    )
    streaming = connection.execution_options(stream_results=True, yield_per=_PORTION)
    for portion in streaming.execute(query).partitions():
        yield from portion


def _ticks(moment: datetime) -> int:
    return filetime(round(moment.timestamp() * 1000) * 1_000_000)
