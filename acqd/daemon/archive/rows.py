"""Rows of archived samples, as the daemon made them: from the same blocks and the state that the daemon had.

Every segment has that state, so segments are independent of each other and can be metered in several processes. The
state after the last block of a segment must be the one that the next segment begins with: where it is another one,
something metered otherwise than the daemon did.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd.archive.segment import Segment
from acqd.archive.segment_file import FULL
from acqd.daemon.archive.origin import Again, kernel_name, state_of
from acqd.errors import InputError
from acqd.garbage import uncollected
from acqd.metering import SampleBlock, WindowBatch
from acqd.metering.joined import joined
from acqd.metering.run import Run
from acqd.telemetry.row import PowerRow, json_lines, rows_of

_TOGETHER = 2_000
"""Windows whose rows are made at once."""
_JOINED = 200_000
"""Samples that are metered at once, at least."""
_AFTER_NS = 10**9
"""A window that begins before the end of the range is complete within this time."""


@dataclass(frozen=True, slots=True)
class Task:
    """One segment, and which of its rows are wanted: those of windows that begin in begin .. end [UTC ns]."""

    path: Path
    begin_ns: int | None = None
    end_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Remade:
    """What became of a segment."""

    path: Path
    rows: int
    lines: bytes
    """The rows as JSON lines: between processes they cost a tenth of what objects do."""
    samples: int
    state_before: str
    """Digest of the state it begins with."""
    state_after: str | None
    """Of the state after its last block; None where not all of it was metered, or nothing follows."""
    kernel: str
    """What metered it now."""
    damage: str = ""
    """What ended it early."""


def remake(task: Task) -> Remade:
    """Meter a segment. Raises InputError for one without a state, OSError."""
    with uncollected():  # a twelfth of the time
        return _remade(task)


def _remade(task: Task) -> Remade:
    segment = Segment.open(task.path)
    state = segment.state()
    try:
        again = Again.of(segment.head.origin, state)
    except ValueError as error:
        raise InputError(task.path, str(error)) from None
    until = None if task.end_ns is None else task.end_ns + _AFTER_NS
    made, taken, damage = list[tuple[int, bytes]](), _Taken(), ""
    try:
        for batch in _metered(_staged(segment.runs(end_ns=until), again, taken), again):
            rows = _rows(batch, segment, again, task)
            made.append((len(rows), json_lines(rows)))
    except InputError as error:
        damage = str(error)
    whole = segment.why == FULL and taken.samples == segment.samples and not damage
    after = _digest(state_of(again.stages, again.meter, again.boot)) if whole else None
    return Remade(
        task.path, sum(count for count, _ in made), b"".join(lines for _, lines in made), taken.samples,
        _digest(state), after, kernel_name(again.meter), damage,
    )  # fmt: skip


@dataclass(slots=True)
class _Taken:
    samples: int = 0
    """That were read."""


def _staged(runs: Iterable[Run], again: Again, taken: _Taken) -> Iterator[SampleBlock]:
    """What the stages leave for the meter."""
    for run in runs:
        taken.samples += run.edges[-1]
        yield from again.stages.apply_run(run)


def _metered(blocks: Iterator[SampleBlock], again: Again) -> Iterator[WindowBatch]:
    """Windows, many at once. Passes on what `blocks` raises, after the windows before it."""
    waiting = list[WindowBatch]()
    try:
        for block in joined(blocks, _JOINED) if again.meter.indifferent else blocks:
            batch = again.meter.feed(block)
            if batch is not None:
                waiting.append(batch)
                if sum(map(len, waiting)) >= _TOGETHER:
                    yield WindowBatch.join(waiting)
                    waiting.clear()
    except InputError:
        if waiting:
            yield WindowBatch.join(waiting)
        raise
    if waiting:
        yield WindowBatch.join(waiting)


def _rows(batch: WindowBatch, segment: Segment, again: Again, task: Task) -> list[PowerRow]:
    """Rows of a batch that begin in the range, with their boots."""
    rows = list(rows_of(batch, segment.head.origin.device, again.boot.name))
    again.boot.stamp(rows)
    begins = batch.utc_ns
    wanted = np.ones(len(batch), dtype=bool)
    if task.begin_ns is not None:
        wanted &= begins >= task.begin_ns
    if task.end_ns is not None:
        wanted &= begins < task.end_ns
    if wanted.all():
        return rows
    channels = len(rows) // max(len(batch), 1)
    return [row for k, row in enumerate(rows) if wanted[k // channels]]


def _digest(state: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()
