"""`acqd replay --archive`: rows of a range of time, in order, and what is known about how exact they are."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from acqd.archive.catalogue import Contents, Gap, contents
from acqd.archive.segment import Segment
from acqd.daemon.archive.compare import Comparison
from acqd.daemon.archive.rows import Remade, Task
from acqd.errors import UserError
from acqd.telemetry.row import parse_row

Run = Callable[[list[Task]], Iterable[Remade]]
"""Remakes tasks, in any order, in any processes."""
_EDGE_NS = 10**9


@dataclass(slots=True)
class Remaking:
    """The whole run."""

    device: str
    rows: int = 0
    segments: int = 0
    recorded_s: float = 0.0
    elapsed_s: float = 0.0
    gaps: list[Gap] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """What is not as the daemon made it, or cannot be told."""
    joints: int = 0
    """Places where one segment follows another and the state of the meter was the same."""
    comparison: Comparison | None = None
    """With rows that are stored."""


def chosen(folder: Path, device: str | None, begin_ns: int | None, end_ns: int | None) -> Contents:
    """Segments of one device in a range. Raises UserError where the device is not clear, or nothing is there."""
    if begin_ns is not None and end_ns is not None and begin_ns >= end_ns:
        raise UserError("--from lies after --to, or at the same time; expected an earlier one")
    late = None if end_ns is None else end_ns + _EDGE_NS
    there = contents(folder, device, begin_ns, late)
    if len(there.devices) > 1:
        raise UserError(f"{folder} holds {', '.join(there.devices)}; choose one with --device")
    if not there.segments:
        others = contents(folder, None).devices
        of = f" of {device}" if device is not None else ""
        raise UserError(
            f"{folder}: no samples{of} in this time; it has {', '.join(others) or 'none'} (acqd archive list)"
        )
    return there


def remade(
    there: Contents, begin_ns: int | None, end_ns: int | None, run: Run, out: BinaryIO | None,
    comparison: Comparison | None = None,
) -> Remaking:  # fmt: skip
    """Write the rows as JSON lines. Raises UserError, OSError."""
    begun = time.perf_counter()
    report = Remaking(there.devices[0], notes=list(there.unreadable), gaps=_within(there.gaps(), begin_ns, end_ns))
    report.comparison = comparison
    tasks = [Task(segment.path, begin_ns, end_ns) for segment in there.segments]
    before: tuple[Segment, Remade] | None = None
    for segment, result in zip(there.segments, _in_order(tasks, run(tasks)), strict=True):
        report.segments += 1
        report.rows += result.rows
        report.recorded_s += result.samples / segment.head.origin.form.rate
        report.notes += _doubts(segment, result, before)
        if before is not None and before[1].state_after == result.state_before:
            report.joints += 1
        if out is not None:
            out.write(result.lines)
        if comparison is not None:
            comparison.take(map(parse_row, result.lines.splitlines()))
        before = segment, result
    report.elapsed_s = time.perf_counter() - begun
    return report


def _in_order(tasks: list[Task], results: Iterable[Remade]) -> Iterator[Remade]:
    """Results as the tasks stand; one that comes early waits."""
    early: dict[Path, Remade] = {}
    left = iter(tasks)
    task = next(left, None)
    for result in results:
        early[result.path] = result
        while task is not None and task.path in early:
            yield early.pop(task.path)
            task = next(left, None)


def _doubts(segment: Segment, result: Remade, before: tuple[Segment, Remade] | None) -> Iterator[str]:
    name, made = segment.path.name, segment.head.origin
    if result.damage:
        yield f"{result.damage}; the rest of this segment has no rows"
    if made.kernel != result.kernel and (before is None or before[0].head.origin.kernel != made.kernel):
        yield f"{name}: was metered by {made.kernel!r}, and is by {result.kernel!r} now: last digits may differ"
    if before is None:
        return
    earlier, last = before
    if segment.head.after == earlier.head.number and last.state_after not in (None, result.state_before):
        yield f"{earlier.path.name}: ends with another state of the meter than the daemon had: its rows may differ"


def _within(gaps: list[Gap], begin_ns: int | None, end_ns: int | None) -> list[Gap]:
    return [
        gap for gap in gaps if (begin_ns is None or gap.end_ns > begin_ns) and (end_ns is None or gap.begin_ns < end_ns)
    ]
