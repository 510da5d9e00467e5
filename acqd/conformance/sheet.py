"""The sheet: all points of all standards, computed in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from acqd.conformance.budget import Budget, budgets
from acqd.conformance.instrument import Instrument
from acqd.conformance.limits import LEFT_OUT
from acqd.conformance.point import Point
from acqd.conformance.points import energy, events, flicker, phasors, quality
from acqd.conformance.terminal import Terminal
from acqd.workers import run_here

LABEL = "By simulation, converter and transformers not included unless described."
GROUPS: dict[str, Callable[[Instrument], Iterator[Point]]] = {
    "frequency": quality.frequency,
    "states": quality.states,
    "magnitude": quality.magnitudes,
    "dips": events.dips_and_swells,
    "interruptions": events.interruptions,
    "unbalance": quality.unbalances,
    "harmonics": quality.harmonic_orders,
    "signalling": quality.signallings,
    "lines-and-bands": quality.low_lines_and_bands,
    "aggregation": quality.aggregation,
    "pinst": flicker.pinst,
    "pst-slow": flicker.PstPoints(0),
    "pst-fast": flicker.PstPoints(3),
    "phasors": phasors.steady,
    "phasors-dynamic": phasors.dynamic,
    "energy": energy.errors,
    "energy-class-1": energy.household_errors,
    "influence": energy.influences,
    "no-load": energy.no_load_and_start,
}
"""Points by the name that --only takes."""
_LONGEST = ("pst-slow", "pst-fast")
"""Groups that begin first, so that no process waits for them at the end."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """All results for one terminal."""

    terminal: Terminal
    points: list[Point]
    budgets: list[Budget]
    complete: bool
    """Whether all groups are in it."""

    @property
    def failed(self) -> list[Point]:
        """Points that miss their limit."""
        return [point for point in self.points if not point.passed]

    @property
    def passed(self) -> bool:
        """Whether every point, and every budget that a limit is known for, is within it."""
        return not self.failed and all(one.passed is not False for one in self.budgets)

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "label": LABEL, "terminal": self.terminal.model_dump(), "passed": self.passed, "complete": self.complete,
            "points": [point.as_json() for point in self.points],
            "failed": [f"{one.standard}: {one.parameter}: {one.signal}: {one.quantity}" for one in self.failed],
            "budgets": [one.as_json() for one in self.budgets], "left_out": list(LEFT_OUT),
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Task:
    group: str
    terminal: Terminal


def points_of(instrument: Instrument, group: str) -> list[Point]:
    """The points of one group."""
    return list(GROUPS[group](instrument))


def _work(task: _Task) -> tuple[str, list[Point]]:
    return task.group, points_of(Instrument(task.terminal), task.group)


def make_sheet(terminal: Terminal, groups: list[str], jobs: int, progress: Callable[[str, float], None]) -> Sheet:
    """Compute `groups` in `jobs` processes (1: in this one); `progress` gets a name and the share that is done."""
    chosen = [name for name in GROUPS if name in groups]
    tasks = [_Task(name, terminal) for name in sorted(chosen, key=lambda name: name not in _LONGEST)]
    found: dict[str, list[Point]] = {}
    results = map(_work, tasks) if jobs == 1 else run_here(_work, tasks, jobs, lambda: None)
    progress(tasks[0].group, 0.0)
    for name, points in results:
        found[name] = points
        progress(name, len(found) / len(tasks))
    ordered = [point for name in GROUPS for point in found.get(name, [])]
    return Sheet(terminal, ordered, budgets(terminal, ordered), len(tasks) == len(GROUPS))
