"""Rows that are not stored yet because they wait in the spool of a daemon on this computer: they are not lost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from acqd.errors import OperationError
from acqd.storage.completeness import Completeness
from acqd.storage.gaps import Cause, Gap
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool import Stream
from acqd.telemetry.spool.segment import SUFFIX, Segment, number_of


def rows_in_spools(state_dir: Path) -> dict[Stream, Ranges]:
    """Numbers of the rows in all spools below the folder, read beside their daemons; nothing is written.

    Raises OperationError for a spool that cannot be read.
    """
    rows: dict[Stream, Ranges] = {}
    try:
        folders = [path for path in state_dir.iterdir() if path.name.startswith("spool-")]  # glob hides refusals
        for file in sorted(file for folder in folders for file in folder.iterdir() if file.suffix == SUFFIX):
            for stream, waiting in _waiting_in(file):
                known = rows.setdefault(stream, Ranges())
                for first, last in waiting:
                    known.add(first, last)
    except OSError as error:
        raise OperationError(f"{error.filename}: {error.strerror}; rows that wait there count as lost") from None
    return rows


def with_waiting(report: Iterable[Completeness], rows: Mapping[Stream, Ranges]) -> list[Completeness]:
    """The report with `waiting` as the cause of missing rows that are in a spool, instead of `lost` or `no rows`."""
    return [replace(one, gaps=_with_waiting(one, rows)) for one in report]


def rows_of(rows: Mapping[Stream, Ranges], device: str | None = None, channel: str | None = None) -> int:
    """How many rows wait, of one device and channel if they are named."""
    return sum(
        len(ranges)
        for stream, ranges in rows.items()
        if device in (None, stream.device) and channel in (None, stream.channel)
    )


def _with_waiting(one: Completeness, rows: Mapping[Stream, Ranges]) -> list[Gap]:
    gaps = [part for gap in one.gaps for part in _parts(one, gap, rows)]
    if not gaps or gaps[-1].cause != Cause.no_rows:
        return gaps
    # the spool is sent in the order of time: what is left in it follows the last row that is stored
    left = rows_of(rows, one.device, one.channel) - sum(gap.rows for gap in gaps if gap.cause == Cause.waiting)
    return [*gaps[:-1], *_divided(gaps[-1], max(0, min(left, gaps[-1].rows)))]


def _waiting_in(path: Path) -> Iterator[tuple[Stream, Ranges]]:
    if number_of(path) is None:
        return
    try:
        yield from Segment.open(path).pending.items()
    except FileNotFoundError:  # the daemon has delivered its last row in the meantime
        return


def _parts(one: Completeness, gap: Gap, rows: Mapping[Stream, Ranges]) -> list[Gap]:
    """The gap, or its rows that wait and those that are lost."""
    spooled = rows.get(Stream(one.device, one.channel, gap.boot))
    if gap.cause != Cause.lost or gap.first_seq is None or spooled is None:
        return [gap]
    last_seq = gap.first_seq + gap.rows - 1
    waiting = sum(max(0, min(last, last_seq) - max(first, gap.first_seq) + 1) for first, last in spooled)
    return _divided(gap, waiting)


def _divided(gap: Gap, waiting: int) -> list[Gap]:
    parts = [replace(gap, rows=waiting, cause=Cause.waiting), replace(gap, rows=gap.rows - waiting)]
    return [part for part in parts if part.rows]
