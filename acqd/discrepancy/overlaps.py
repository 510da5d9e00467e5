"""Rows that two recordings share, such as logs that overlap or a second export: they would count twice as evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from acqd.arrays import Floats
from acqd.models.segments import Segment
from acqd.numerics import runs_of_true

_MEAN_ROWS = 25
"""A second: what two recordings differ by in single rows of one meter cancels in such means."""
_DIGITS = 1e-5
"""Of the power: a bundle holds its reference in single precision."""
_BY_CHANCE = 1e-4
"""Probability that such means of the noise of two measurements vanish as far: their deviation is 0.2 of that of the
rows. Below 0.05 it is for rows interpolated at other times, as the steps from row to row add up to nothing; ten means
tell the two apart, and the few seconds that pieces of logs without a date seem to share do not."""


def without_shared_rows(
    segments: list[Segment], reference: list[Segment], step_s: float, least_rows: int
) -> tuple[list[Segment], list[str]]:
    """Every row of the meter once, and none of the reference, and a line that names recordings with shared rows.

    What is left of a segment counts from `least_rows` rows on.
    """
    kept: list[Segment] = []
    shared: dict[str, str] = {}
    earlier = [(each, f"{each.recording} in the reference") for each in reference]
    for segment in sorted(segments, key=lambda each: each.start_s):
        free = np.ones(len(segment.P), dtype=bool)
        earlier = [pair for pair in earlier if _end_s(pair[0], step_s) > segment.start_s]
        for other, name in earlier:
            if (rows := _shared(segment, other, step_s)) is not None:
                free[rows] = False
                shared.setdefault(segment.recording, name)
        if free.all():
            parts = [segment]
        else:
            parts = [_part(segment, *run, step_s) for run in runs_of_true(free) if run[1] - run[0] >= least_rows]
        kept += parts
        earlier += [(part, part.recording) for part in parts]
    if not shared:
        return segments, []
    first, whose = next(iter(shared.items()))
    which = f"{first} holds power rows of {whose}"
    if len(shared) > 1:
        which = f"{len(shared)} recordings hold power rows of others, the first: {first} those of {whose}"
    return kept, [f"{which}; they count once"]


def _end_s(segment: Segment, step_s: float) -> float:
    """Unix time, s."""
    return segment.start_s + len(segment.P) * step_s


def _shared(segment: Segment, other: Segment, step_s: float) -> slice | None:
    """Rows of a segment that another one holds, too; None where the power at the same times is not the same."""
    ahead = (other.start_s - segment.start_s) / step_s
    first, last = max(0, int(np.ceil(ahead))), min(len(segment.P), int(np.floor(ahead + len(other.P) - 1)) + 1)
    if last - first < 2 * _MEAN_ROWS:
        return None
    at = np.arange(first, last) - ahead
    apart = segment.P[first:last] - np.interp(at, np.arange(len(other.P)), other.P)
    alike = float(np.abs(apart).max()) <= _DIGITS * float(np.abs(other.P).max())
    return slice(first, last) if alike or _cancels(apart) else None


def _cancels(apart: Floats) -> bool:
    """Whether differences [T] W of two powers vanish in means over a second."""
    whole = len(apart) // _MEAN_ROWS * _MEAN_ROWS
    means = apart[:whole].reshape(-1, _MEAN_ROWS).mean(axis=1)
    least = 2 * float(gammaincinv(len(means) / 2, _BY_CHANCE))  # of chi-squared, with as many degrees of freedom
    return _MEAN_ROWS * float((means**2).sum()) <= least * float((apart**2).mean())


def _part(segment: Segment, first: int, last: int, step_s: float) -> Segment:
    """Some rows of a segment, whose neighbours are known angles."""
    rows = slice(first, last)
    angles, before, _ = segment.extended()

    def of(values: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        return {name: each[rows] for name, each in values.items()}

    return replace(
        segment, q=segment.q[rows], P=segment.P[rows], tau=None if segment.tau is None else segment.tau[rows],
        signals=of(segment.signals), channels=of(segment.channels), start_s=segment.start_s + first * step_s,
        labels={name: each[rows] for name, each in segment.labels.items()},
        before=angles[: before + first], after=angles[before + last :],
    )  # fmt: skip
