"""`acqd replay --archive`: rows of samples that a daemon has kept, to the last bit."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from acqd.cli.archive import gap_json
from acqd.cli.options import utc_option
from acqd.cli.terminal import terminal
from acqd.daemon.archive.compare import Comparison, stored_rows
from acqd.daemon.archive.replay import Remaking, chosen, remade
from acqd.daemon.archive.rows import Remade, Task, remake
from acqd.daemon.output_file import output_file
from acqd.errors import OperationError
from acqd.timestamps import rfc3339
from acqd.workers import run_here_as_well

_FEW = 3
"""Segments that are metered sooner than a process has started."""


@dataclass(frozen=True, slots=True)
class ArchiveOptions:
    """Of the command line."""

    folder: Path
    since: str | None
    until: str | None
    device: str | None
    out: Path | None
    against: str | None


def replay_archive(options: ArchiveOptions, *, json: bool) -> None:
    """Raises UserError; OperationError where rows differ from those that are stored."""
    begin, end = utc_option("--from", options.since), utc_option("--to", options.until)
    there = chosen(options.folder, options.device, begin, end)
    comparison = None
    if options.against is not None:
        first = there.segments[0].begin_ns if begin is None else begin
        last = max(segment.end_ns for segment in there.segments) if end is None else end
        comparison = Comparison.of(stored_rows(options.against, there.devices[0], first, last))
    with ExitStack() as stack:
        out = stack.enter_context(output_file(options.out)) if options.out is not None else None
        report = remade(there, begin, end, _run, out, comparison)
    if options.out is None or str(options.out) != "-":
        if json:
            print(orjson.dumps(_as_json(report)).decode())
        else:
            _print(report)
    if comparison is not None and comparison.different:
        raise OperationError(f"{comparison.different} rows differ from those in {options.against}")


def _run(tasks: list[Task]) -> Iterable[Remade]:
    processors = len(os.sched_getaffinity(0))
    if len(tasks) < _FEW or processors < 2:
        return map(remake, tasks)
    return _in_processes(tasks, processors)


def _in_processes(tasks: list[Task], processors: int) -> Iterator[Remade]:
    yield from run_here_as_well(remake, tasks, processors)


def _as_json(report: Remaking) -> dict[str, Any]:
    told: dict[str, Any] = {
        "device": report.device, "rows": report.rows, "segments": report.segments, "recorded_s": report.recorded_s,
        "elapsed_s": report.elapsed_s, "joints_alike": report.joints, "notes": report.notes,
        "gaps": [gap_json(gap) for gap in report.gaps],
    }  # fmt: skip
    if (found := report.comparison) is not None:
        told["against"] = {
            "same": found.same, "different": found.different, "not_stored": found.not_stored,
            "not_archived": found.not_archived, "examples": found.examples,
        }  # fmt: skip
    return told


def _print(report: Remaking) -> None:
    console = terminal()
    for note in report.notes:
        console.print(f"acqd: {note}")
    for gap in report.gaps:
        console.print(f"gap: {rfc3339(gap.begin_ns, 3)}, {(gap.end_ns - gap.begin_ns) / 1e9:.3f} s: {gap.why}")
    console.print(
        f"{report.rows} rows of {report.device} from {report.recorded_s:.1f} s of samples in {report.elapsed_s:.2f} s; "
        f"{report.joints} of {max(report.segments - 1, 0)} joints of segments with the state that the daemon had"
    )
    if (found := report.comparison) is not None:
        for example in found.examples:
            console.print(f"differs: {example}")
        console.print(
            f"stored rows: {found.same} the same to the last bit, {found.different} differ, "
            f"{found.not_stored} are not stored, of {found.not_archived} the samples are not in the archive"
        )
