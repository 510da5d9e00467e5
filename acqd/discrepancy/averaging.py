"""Means of the meter: power in question that is smoother than that of the reference, or less smooth, is no effect.

A mean over 0.2 s hides what the arm takes in fast motion, and many effects would explain a part of what is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.metrics import predictions
from acqd.models.segments import Segment

_ROWS = (1, 3, 5, 7, 11, 17, 25, 37, 51)
"""Lengths of means: odd, so that a mean is in the middle of its rows; up to the 2 s that `acqd dataset build` tries."""


@dataclass(frozen=True, slots=True)
class _Fit:
    """How well the predicted power, averaged over each of `_ROWS`, explains the power of a recording."""

    left: Floats
    """[lengths] share of the power's variance that remains."""
    late: Floats
    """[lengths] rows that the power is later than the mean."""


def with_like_means(subject: Subject) -> tuple[Subject, list[str]]:
    """The recordings in question with power as fast as that of the reference, and a line where it was not.

    Fast power that only the reference shows is put into the recordings in question as the model predicts it; fast power
    that the reference does not show is averaged there as well.
    """
    if not subject.reference:
        return subject, []
    asked, before = [*subject.fit, *subject.held_out], subject.reference
    predicted = predictions(subject.model, asked)
    now, then = _fits(predicted, asked), _fits(predictions(subject.model, before), before)
    if min(len(now), len(then)) < THRESHOLDS.few_recordings:
        return subject, []
    step_s = subject.data.step_s
    if (rows := _longer(now, then)) > 1:
        restored = [_restored(segment, power, rows) for segment, power in zip(asked, predicted, strict=True)]
        what, other, remedy = "recordings in question", "reference", "the fast part is taken from the model"
    elif (rows := _longer(then, now)) > 1:
        restored = [replace(segment, P=_mean(segment.P, rows)) for segment in asked]
        what, other, remedy = "reference", "recordings in question", "these are averaged as well"
    else:
        return subject, []
    count = len(subject.fit)
    line = (
        f"the power of the {what} is as if it were a mean over {rows * step_s:.2g} s, that of the {other} is not: "
        f"{remedy}; measure with the same meter and settings"
    )
    return replace(subject, fit=restored[:count], held_out=restored[count:]), [line]


def _fits(predicted: Sequence[Floats], segments: Sequence[Segment]) -> list[_Fit]:
    """Of recordings in which the predicted power changes."""
    moving = THRESHOLDS.delay_least_moving_W
    least = THRESHOLDS.block_least_rows + max(_ROWS)
    return [
        _fit(power, segment.P)
        for power, segment in zip(predicted, segments, strict=True)
        if len(power) > least and power.std() > moving and segment.P.std() > 0
    ]


def _fit(predicted: Floats, P: Floats) -> _Fit:
    """With the scale and the delay, to a part of a row, at which each mean fits best."""
    reach = max(_ROWS)
    measured = _from_zero_to_zero(P)
    size = next_fast_len(len(measured) + 2 * reach)
    spectrum, deviation = rfft(measured, size), float(measured.std())
    pairs = []
    for rows in _ROWS:
        mean = _from_zero_to_zero(_mean(predicted, rows))
        products = irfft(spectrum * rfft(mean, size).conj(), size) / len(P) - measured.mean() * mean.mean()
        near = np.concatenate([products[-reach:], products[: reach + 1]]) / (deviation * max(float(mean.std()), 1e-12))
        late, correlation = _peak(near)
        pairs.append((max(1 - correlation**2, 1e-12), late - reach))
    left, late = np.array(pairs).T
    return _Fit(left, late)


def _from_zero_to_zero(values: Floats) -> Floats:
    """[T] without the line from the first to the last value, so that a shift loses nothing at the ends."""
    return np.asarray(values - np.linspace(values[0], values[-1], len(values)))


def _peak(values: Floats) -> tuple[float, float]:
    """Place and height of the largest value, by the parabola through it and its neighbours."""
    at = int(np.clip(values.argmax(), 1, len(values) - 2))
    before, best, after = values[at - 1 : at + 2]
    bend = min(float(before - 2 * best + after), -1e-12)
    shift = float(np.clip((before - after) / (2 * bend), -0.5, 0.5))
    return at + shift, float(best - (before - after) * shift / 4)


def _longer(slow: list[_Fit], fast: list[_Fit]) -> int:
    """Rows over which the power of `slow` is averaged and that of `fast` is not; 1: both are alike.

    As for a delay, wrong columns gain something by a mean, too.
    """
    gains, other = (np.median([np.log(fit.left / fit.left[0]) for fit in fits], axis=0) for fits in (slow, fast))
    best = int(gains.argmin())
    beyond = np.exp(min(float(other[best]), 0.0)) - np.exp(gains[best])
    return _ROWS[best] if beyond > THRESHOLDS.column_error else 1


def _restored(segment: Segment, predicted: Floats, rows: int) -> Segment:
    """With the fast part of the predicted power [T] W, as late as the power is."""
    late = _fit(predicted, segment.P).late[_ROWS.index(rows)] if segment.P.std() > 0 and predicted.std() > 0 else 0.0
    fast = predicted - _mean(predicted, rows)
    t = np.arange(len(fast), dtype=np.float64)
    return replace(segment, P=segment.P + np.interp(t - late, t, fast))


def _mean(values: Floats, rows: int) -> Floats:
    """[T] over `rows` rows around each; beyond the ends the outer values continue."""
    half = rows // 2
    sums = np.cumsum(np.pad(values, (half + 1, half), mode="edge"))
    return np.asarray((sums[rows:] - sums[:-rows]) / rows)
