"""Reading rows back from segments, a bounded number of bytes a call."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from acqd.telemetry.spool.record import ROW, Record, Stream, needed_at, record_at, records
from acqd.telemetry.spool.segment import START, Segment

_CHUNK = 1 << 16
_MOST_BYTES = 1 << 18
"""Read by one call at most: the event loop has other work."""
_Row = tuple[Stream, int, bytes]


def read_rows(
    segments: Sequence[Segment], number: int, offset: int, most: int, wanted: Callable[[Stream, int], bool]
) -> tuple[list[_Row], int, int, list[Segment]]:
    """Rows that wait and are wanted from a position on, the position after them, and segments found damaged."""
    rows: list[_Row] = []
    damaged: list[Segment] = []
    left = _MOST_BYTES
    for segment in list(segments):
        if segment.number < number:
            continue
        if segment.number > number:
            number, offset = segment.number, START
        while segment.pending and offset < segment.size:
            if left <= 0:
                return rows, number, offset, damaged
            before = offset
            for record, offset in _some(segment, before):
                if record is None:
                    damaged += [segment] if segment not in damaged else []
                elif record.kind == ROW and _waits(segment, record, wanted):
                    rows.append((record.stream, record.seq, record.payload))
                    if len(rows) >= most:
                        return rows, number, offset, damaged
            left -= offset - before
        offset = segment.size
    return rows, number, offset, damaged


def _waits(segment: Segment, record: Record, wanted: Callable[[Stream, int], bool]) -> bool:
    stream = record.stream
    waiting = segment.pending.get(stream)
    return waiting is not None and record.seq in waiting and wanted(stream, record.seq)


def _some(segment: Segment, offset: int) -> Iterator[tuple[Record | None, int]]:
    """Records of the next chunk with the offsets after them; None for damage, which is stepped over."""
    try:
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
    except OSError:
        yield None, segment.size
        return
    yield None, segment.size
