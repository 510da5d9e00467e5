"""Values of a span as CSV: rows as they are stored, and means of roll-ups for spans that hold millions of rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

import sqlalchemy as sa

from acqd.storage.schema import ROLLUPS, power
from acqd.timestamps import filetime, rfc3339
from acqd.web.history import ROWS_UP_TO_S, Span, rollup_for

_QUANTITIES = {"Vrms": "V", "Irms": "A", "P": "W", "S": "VA", "PF": "", "f": "Hz", "W": "kWh"}
_AT_ONCE = 5_000
_TICKS_OF_1970 = 116_444_736_000_000_000


def lines(engine: sa.Engine, span: Span, end: float) -> Iterator[str]:
    """The header and a line per row, or per bucket of a roll-up; times are UTC, the end of the span is not included.

    Longer spans than half an hour come from roll-ups, where these have any values.
    """
    with engine.connect() as connection:
        begin = end - span.seconds
        table = ROLLUPS[rollup_for(span.seconds)]
        rolled = (
            sa.select(table.c.start, table.c.channel, *(table.c[name] for name in _QUANTITIES), table.c.rows)
            .where(table.c.device == span.device, table.c.start >= int(begin), table.c.start < end)
            .order_by(table.c.start, table.c.channel)
        )
        if span.seconds > ROWS_UP_TO_S and connection.execute(rolled.limit(1)).first():
            yield from _csv(connection, rolled, "rows")
            return
        first, last = (filetime(int(at * 1e9)) for at in (begin, end))
        rows = (
            sa.select(power.c.filetime, power.c.channel, *(power.c[name] for name in _QUANTITIES), power.c.flags)
            .where(power.c.device == span.device, power.c.filetime >= first, power.c.filetime < last)
            .order_by(power.c.filetime, power.c.channel)
        )
        yield from _csv(connection, rows, "flags")


def _csv(connection: sa.Connection, chosen: sa.Select[Any], last: str) -> Iterator[str]:
    named = [f"{name}_{unit}" if unit else name for name, unit in _QUANTITIES.items()]
    yield ",".join(["time", "channel", *named, last]) + "\r\n"
    result = connection.execution_options(yield_per=_AT_ONCE).execute(chosen)
    for part in result.partitions(_AT_ONCE):
        text = io.StringIO()
        writer = csv.writer(text)
        for at, channel, *values, end in part:
            ns = at * 10**9 if last == "rows" else (at - _TICKS_OF_1970) * 100
            writer.writerow([rfc3339(ns), channel, *values, " ".join(end) if isinstance(end, list) else end])
        yield text.getvalue()
