"""Budgets of a service that runs for long, and whether samples keep within them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tools.bench.report import Figure
from tools.studies.soak.usage import Sample

_MB = 1e6
_WARM = 0.2
"""Share of the run that is not judged: caches fill."""
_SLOPE_MB_H, _STEP_MB = 1.0, 3.0
"""Growth of the resident memory: per hour, and at least over a run (an allocator grows in steps)."""
_DESCRIPTORS, _THREADS = 4, 2
_LINES, _LINES_H = 80, 200
"""Lines of a log: for the start and two dozen robot logs, and per hour."""
_STORED_MB = 3.0
"""Two segments of a spool whose rows are delivered, and a beginning."""


def figures(name: str, samples: Sequence[Sample]) -> Iterator[Figure]:
    """What a service took, with its budgets. `samples`: two or more, in order of time, of one service."""
    times = np.array([sample.at_s for sample in samples]) / 3600
    memory = np.array([sample.usage.rss for sample in samples]) / _MB
    late = times >= times[0] + _WARM * (times[-1] - times[0])
    judged = [sample for sample, after in zip(samples, late, strict=True) if after]
    hours = float(times[-1] - times[0])
    slope = theil_sen(times[late], memory[late])
    grown = slope * float(times[late][-1] - times[late][0])
    yield Figure(name, "memory, median", float(np.median(memory)), "MB")
    yield Figure(name, "memory, most", float(memory.max()), "MB")
    yield Figure(name, "memory, slope (Theil-Sen)", slope, "MB/h")
    yield Figure(name, "memory, growth over the run", grown, "MB", f"<= {max(_STEP_MB, _SLOPE_MB_H * hours):.3g}")
    descriptors = [sample.usage.descriptors for sample in judged]
    threads = [sample.usage.threads for sample in judged]
    yield Figure(name, "descriptors, growth", descriptors[-1] - min(descriptors), "", f"<= {_DESCRIPTORS}")
    yield Figure(name, "threads, growth", threads[-1] - min(threads), "", f"<= {_THREADS}")
    yield Figure(name, "log lines", samples[-1].log_lines, "", f"<= {_LINES + _LINES_H * hours:.0f}")
    if any(sample.stored for sample in samples):
        most = max(sample.stored for sample in judged) / _MB
        yield Figure(name, "spool, most", most, "MB", f"<= {_STORED_MB:g}")


def theil_sen(x: ArrayLike, y: ArrayLike) -> float:
    """Median of the slopes between all pairs of (at most 500) points: single peaks do not move it."""
    points = np.stack([np.asarray(x, float), np.asarray(y, float)])
    chosen = np.unique(np.linspace(0, points.shape[1] - 1, min(points.shape[1], 500)).astype(int))
    first, second = np.triu_indices(len(chosen), 1)
    steps = points[:, chosen[second]] - points[:, chosen[first]]
    return float(np.median(steps[1] / steps[0])) if steps.size else 0.0
