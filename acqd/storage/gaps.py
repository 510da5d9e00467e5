"""Causes of missing rows, from the rows on both sides of a gap."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from acqd.timestamps import rfc3339

TICKS = 10_000_000
"""FILETIME ticks per second."""
_FILETIME_1970 = 116_444_736_000_000_000


class Cause(StrEnum):
    """Why rows are missing."""

    not_metered = "not metered"
    """The row after the gap is flagged `gap`: the source or MAIN_FAST was away."""
    restart = "daemon not running"
    """The boot changes, or rows end or begin within the day."""
    clock_step = "clock step"
    """The clock was set: the time is missing, the rows are not."""
    lost = "lost"
    """Rows were numbered and are not stored: on their way, dropped, or lost."""
    waiting = "waiting"
    """Rows are in the spool of a daemon on this computer."""
    no_rows = "no rows"
    """Nothing after the last row: the daemon does not run, or its rows are still on their way."""


@dataclass(frozen=True, slots=True)
class Span:
    """Begin and end in FILETIME ticks."""

    begin: int
    end: int


@dataclass(slots=True)
class Break:
    """A row that begins or ends a boot, or does not follow the row before it."""

    boot: str
    seq: int
    filetime: int
    flags: str
    """JSON."""
    seq_before: int | None = None
    """Of the row before in the same boot; None: the first row of its boot in the span."""
    filetime_before: int = 0
    ends: bool = False
    """The last row of its boot in the span."""


@dataclass(frozen=True, slots=True)
class Gap:
    """Rows missing between two moments (RFC 3339, UTC)."""

    begin: str
    end: str
    rows: int
    cause: Cause
    boot: str
    """Of the row after the gap; empty at the end of the day."""
    first_seq: int | None = None
    """Number of the first missing row, where rows of this boot are missing."""


def gaps_of(breaks: Iterable[Break], span: Span, interval: int) -> list[Gap]:
    """The gaps of one channel; `breaks` in the order of time, `interval` [ticks] between two rows."""
    gaps: list[Gap] = []
    reached = span.begin
    begun: set[str] = set()  # boots between their first and last row; two overlap when the clock was set back
    for row in breaks:
        if row.seq_before is None and begun:
            begun.add(row.boot)
        elif row.seq_before is None:
            begun.add(row.boot)
            gaps += _before_boot(row, reached, interval, continued=reached == span.begin)
        else:
            gaps += _within_boot(row, interval)
        if row.ends:
            begun.discard(row.boot)
        reached = max(reached, row.filetime + interval)
    if span.end - reached > 2 * interval:
        gaps.append(_gap(reached, span.end, (span.end - reached) // interval, Cause.no_rows, ""))
    return gaps


def _before_boot(row: Break, reached: int, interval: int, *, continued: bool) -> list[Gap]:
    """What is missing before the first row that a boot has in this span; it may have begun before the span."""
    missing = (row.filetime - reached) / interval
    missing = max(0, int(missing) if continued else round(missing))
    flags = _flags(row)
    if row.seq and "start" not in flags and "." not in row.boot:  # rows 0 to seq - 1 were numbered
        cause = Cause.not_metered if "gap" in flags else Cause.lost
        numbered = missing if continued else min(missing, row.seq)
    else:
        cause, numbered = Cause.lost, 0
    middle = row.filetime - numbered * interval
    parts = [
        _gap(reached, middle, missing - numbered, Cause.restart, row.boot),
        _gap(middle, row.filetime, numbered, cause, row.boot, row.seq - numbered),
    ]
    return [part for part in parts if part.rows]


def _within_boot(row: Break, interval: int) -> list[Gap]:
    """What is missing before a row that does not follow its predecessor."""
    assert row.seq_before is not None
    missing, begin = row.seq - row.seq_before - 1, row.filetime_before + interval
    if missing:
        cause = Cause.not_metered if "gap" in _flags(row) else Cause.lost
        return [_gap(begin, row.filetime, missing, cause, row.boot, row.seq_before + 1)]
    if row.filetime - begin > interval:
        return [_gap(begin, row.filetime, 0, Cause.clock_step, row.boot)]
    return []


def _flags(row: Break) -> frozenset[str]:
    return frozenset(json.loads(row.flags))


def _gap(begin: int, end: int, rows: int, cause: Cause, boot: str, first_seq: int | None = None) -> Gap:
    return Gap(_stamp(begin), _stamp(max(begin, end)), rows, cause, boot, first_seq)


def _stamp(ticks: int) -> str:
    return rfc3339((ticks - _FILETIME_1970) * 100, digits=3)
