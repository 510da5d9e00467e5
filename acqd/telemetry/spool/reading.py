"""Reading rows back from segments, a bounded number of bytes a call."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from acqd.telemetry.spool.record import ROW, Record, Stream, needed_at, record_at, records
from acqd.telemetry.spool.segment import START, Segment

_CHUNK = 1 << 16
_MOST_BYTES = 1 << 18
"""Read by one call at most: the event loop has other work."""
_Row = tuple[Stream, int, bytes]


class Found(NamedTuple):
    """What one call has read."""

    rows: list[_Row]
    number: int
    """Of the segment where reading goes on."""
    offset: int
    damaged: set[Segment]
    """Segments with bytes that are no records."""
    failed: list[tuple[Segment, OSError]]
    """Segments that the disk does not give out now; reading went on behind them."""


def read_rows(
    segments: Sequence[Segment],
    number: int,
    offset: int,
    most: int,
    wanted: Callable[[Stream, int], bool],
    readable: Callable[[Segment], bool] = lambda _: True,
) -> Found:
    """Rows that wait and are wanted from a position on, of `readable` segments."""
    found = Found([], number, offset, set(), [])
    left = _MOST_BYTES
    for segment in [segment for segment in segments if segment.number >= number]:
        if segment.number > number:
            number, offset = segment.number, START
        while segment.pending and offset < segment.size and readable(segment):
            if left <= 0:
                return found._replace(number=number, offset=offset)
            before = offset
            try:
                for record, offset in _some(segment, before):
                    segment.trouble = ""
                    if record is None:
                        found.damaged.add(segment)
                    elif record.kind == ROW and _waits(segment, record, wanted):
                        found.rows.append((record.stream, record.seq, record.payload))
                        if len(found.rows) >= most:
                            return found._replace(number=number, offset=offset)
            except OSError as error:
                found.failed.append((segment, error))
                break
            left -= offset - before
        offset = segment.size
    return found._replace(number=number, offset=offset)


def _waits(segment: Segment, record: Record, wanted: Callable[[Stream, int], bool]) -> bool:
    stream = record.stream
    waiting = segment.pending.get(stream)
    return waiting is not None and record.seq in waiting and wanted(stream, record.seq)


def _some(segment: Segment, offset: int) -> Iterator[tuple[Record | None, int]]:
    """Records of the next chunk with the offsets after them; None for damage, which is stepped over.

    Raises OSError: what the disk does not give out is no damage.
    """
    data = segment.read(offset, _CHUNK)
    if (needed := needed_at(data, 0)) > len(data):
        data = segment.read(offset, needed)
    at = 0
    while (record := record_at(data, at)) is not None:
        at = record.end
        yield record, offset + at
    if offset + at >= segment.size or (at and offset + at + needed_at(data, at) <= segment.size):
        return  # the next chunk begins here
    yield None, offset + at
    for record in records(segment.read(offset + at, segment.size), 1):
        yield record, offset + at + record.end
    yield None, segment.size
