"""Past values for charts, from rows or from roll-ups."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from acqd.storage import known_rows
from acqd.storage.schema import ROLLUPS, power
from acqd.timestamps import filetime

_TICKS = 10_000_000
_ROW_TICKS = _TICKS // 25
_MOST_POINTS = 1500
ROWS_UP_TO_S = 1800
"""Longer spans come from roll-ups, where these exist: 30 min hold 45 000 rows per channel."""
_ROLLED_UP_TO_S = {60: 36 * 3600, 900: 1e18}
_QUANTITIES = ("P", "Vrms", "Irms", "PF", "f", "W")
LONGEST_S = 366 * 86_400
_LATEST_S = 7.2e9  # in the year 2198: FILETIME stays in 64 bit


@dataclass(frozen=True, slots=True)
class Span:
    """What a chart shows."""

    device: str
    seconds: float
    quantity: str = "P"
    end: float | None = None
    """Unix s; None: now."""

    def __post_init__(self) -> None:
        if self.quantity not in _QUANTITIES:
            raise ValueError(f"quantity {self.quantity!r}: expected one of {', '.join(_QUANTITIES)}")
        if not 1 <= self.seconds <= LONGEST_S:
            raise ValueError(f"seconds {self.seconds:g}: expected 1 to {LONGEST_S}")
        if self.end is not None and not 0 < self.end < _LATEST_S:
            raise ValueError(f"end {self.end:g}: expected Unix seconds")


def rollup_for(span_s: float) -> int:
    """Bucket length [s] of the roll-ups for a span of this length."""
    return next(each for each, limit in _ROLLED_UP_TO_S.items() if span_s <= limit)


def devices(engine: sa.Engine) -> list[str]:
    """Names of all devices with rows."""
    with engine.connect() as connection:
        return known_rows.devices(connection)


def history(engine: sa.Engine, span: Span, now: float | None = None) -> dict[str, Any]:
    """Times [Unix s] and means per channel in equal buckets; `from`: the table the values are from."""
    end = span.end or (time.time() if now is None else now)
    begin = end - span.seconds
    with engine.connect() as connection:
        if span.seconds > ROWS_UP_TO_S:
            seconds = rollup_for(span.seconds)
            rolled = _rolled_up(connection, span, begin, end, seconds)
            if rolled:
                newer = float(rolled[-1][0]) + seconds
                tail = _rows(connection, span, newer, end, seconds) if newer < end else []
                return _columns([*rolled, *tail], f"power_{seconds // 60}min")
        return _columns(_rows(connection, span, begin, end), "power")


def _rolled_up(connection: sa.Connection, span: Span, begin: float, end: float, seconds: int) -> list[Any]:
    table = ROLLUPS[seconds]
    chosen = sa.select(table.c.start, table.c.channel, table.c[span.quantity]).where(
        table.c.device == span.device, table.c.start >= int(begin), table.c.start < end
    )
    return list(connection.execute(chosen.order_by(table.c.start)))


def _rows(connection: sa.Connection, span: Span, begin: float, end: float, bucket_s: float | None = None) -> list[Any]:
    """Means of buckets of the rows, by FILETIME, which is an integer in every database.

    Buckets that would be shorter than a row are left out: every row has its own.
    """
    first = filetime(int(begin * 1e9))
    width = int(((end - begin) / _MOST_POINTS if bucket_s is None else bucket_s) * _TICKS)
    width = width if width > _ROW_TICKS else 1
    number = (power.c.filetime - first) // width
    column = power.c[span.quantity]
    value = sa.func.max(column) if span.quantity == "W" else sa.func.avg(column)
    chosen = (
        sa.select(number.label("bucket"), power.c.channel, value)
        .where(power.c.device == span.device, power.c.filetime >= first, power.c.filetime < filetime(int(end * 1e9)))
        .group_by("bucket", power.c.channel)
        .order_by("bucket")
    )
    return [(begin + k * width / _TICKS, channel, mean) for k, channel, mean in connection.execute(chosen)]


def _columns(rows: list[Any], table: str) -> dict[str, Any]:
    channels = sorted({channel for _, channel, _ in rows})
    times = sorted({float(at) for at, _, _ in rows})
    place = {at: k for k, at in enumerate(times)}
    values: dict[str, list[float | None]] = {channel: [None] * len(times) for channel in channels}
    for at, channel, value in rows:
        values[channel][place[float(at)]] = value
    return {"from": table, "time": times, "channels": values}
