"""Meters that smooth on one side only: power that is smoother, or less smooth, than the reference is no effect.

A mean over 0.2 s hides what the arm takes in fast motion, and many effects would explain a part of what is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.optimize import isotonic_regression

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.usual_error import grown
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.first_order import filtered
from acqd.models.metrics import predictions
from acqd.models.segments import Segment

_MEANS = (3, 5, 7, 11, 17, 25, 37, 51)
"""Rows of means: odd, so that a mean is in the middle of its rows; up to the 2 s that `acqd dataset build` tries."""
_CONSTANTS = (2, 3, 5, 8, 12, 20)
"""Rows of the time constants of filters of the first order."""
_REACH = max(_MEANS)
"""Rows that power may be late or early by."""


@dataclass(frozen=True, slots=True)
class _Smoothing:
    """By a mean over some rows, or by a filter of the first order."""

    rows: int
    filters: bool = False

    def of(self, values: Floats) -> Floats:
        """[T] smoothed; the outer values continue beyond the ends."""
        if self.filters:
            keep = float(np.exp(-1 / self.rows))
            return filtered((1 - keep, 0.0), -keep, values, values[:1] * keep)[0]
        half = self.rows // 2
        sums = np.cumsum(np.pad(values, (half + 1, half), mode="edge"))
        return np.asarray((sums[self.rows :] - sums[: -self.rows]) / self.rows)

    def text(self, step_s: float) -> str:
        """In words."""
        seconds = f"{self.rows * step_s:.2g} s"
        return f"smoothed with a time constant of {seconds}" if self.filters else f"a mean over {seconds}"


_NOTHING = _Smoothing(1)
_SMOOTHINGS = (_NOTHING, *map(_Smoothing, _MEANS), *(_Smoothing(rows, filters=True) for rows in _CONSTANTS))


@dataclass(frozen=True, slots=True)
class _Fit:
    """How well the predicted power, by each of `_SMOOTHINGS`, explains the power of a recording."""

    left: Floats
    """[smoothings] share of the power's variance that remains."""
    late: Floats
    """[smoothings] rows that the power is later than the smoothed prediction."""
    by_a_curve: float
    """Share of the power's variance that remains where the power is a curve of the prediction that only rises."""
    deviation_W: float
    """Of the power."""

    @property
    def error(self) -> float:
        """W RMS without any smoothing, at the best delay and scale."""
        return float(self.deviation_W * np.sqrt(self.left[0]))


def with_like_means(subject: Subject) -> tuple[Subject, list[str]]:
    """The recordings in question with power as fast as that of the reference, and a line where it was not.

    Fast power that only the reference shows is put into the recordings in question as the model predicts it; fast power
    that the reference does not show is smoothed there as well.
    """
    if not subject.reference:
        return subject, []
    asked, before = [*subject.fit, *subject.held_out], subject.reference
    predicted = predictions(subject.model, asked)
    now, then = _fits(predicted, asked), _fits(predictions(subject.model, before), before)
    if min(len(now), len(then)) < THRESHOLDS.few_recordings:
        return subject, []
    step_s = subject.data.step_s
    if (smoothing := _smoother(now, then)) is not _NOTHING:
        alike = [_restored(segment, power, smoothing) for segment, power in zip(asked, predicted, strict=True)]
        what, other, remedy = "recordings in question", "reference", "the fast part is taken from the model"
    elif (smoothing := _smoother(then, now)) is not _NOTHING:
        alike = [replace(segment, P=smoothing.of(segment.P)) for segment in asked]
        what, other, remedy = "reference", "recordings in question", "these are smoothed as well"
    else:
        return subject, []
    count = len(subject.fit)
    line = (
        f"the power of the {what} is as if it were {smoothing.text(step_s)}, that of the {other} is not: {remedy}; "
        "measure with the same meter and settings"
    )
    return replace(subject, fit=alike[:count], held_out=alike[count:]), [line]


def _fits(predicted: Sequence[Floats], segments: Sequence[Segment]) -> list[_Fit]:
    """Of recordings in which the predicted power changes."""
    moving = THRESHOLDS.delay_least_moving_W
    least = THRESHOLDS.block_least_rows + _REACH
    return [
        _fit(power, segment.P)
        for power, segment in zip(predicted, segments, strict=True)
        if len(power) > least and power.std() > moving and segment.P.std() > 0
    ]


def _fit(predicted: Floats, P: Floats) -> _Fit:
    """With the scale and the delay, to a part of a row, at which each smoothing fits best."""
    measured = _from_zero_to_zero(P)
    size = next_fast_len(len(measured) + 2 * _REACH)
    spectrum, deviation = rfft(measured, size), max(float(measured.std()), 1e-12)
    pairs = []
    for smoothing in _SMOOTHINGS:
        mean = _from_zero_to_zero(smoothing.of(predicted))
        products = irfft(spectrum * rfft(mean, size).conj(), size) / len(P) - measured.mean() * mean.mean()
        scale = deviation * max(float(mean.std()), 1e-12)
        late, correlation = _peak(np.concatenate([products[-_REACH:], products[: _REACH + 1]]) / scale)
        pairs.append((max(1 - correlation**2, 1e-12), late - _REACH))
    left, late = np.array(pairs).T
    return _Fit(left, late, _left_by_a_curve(_from_zero_to_zero(predicted), measured, round(late[0])), float(P.std()))


def _left_by_a_curve(predicted: Floats, measured: Floats, late: int) -> float:
    """Share of the variance of `measured` that no curve of the prediction explains that only rises."""
    pairs = (
        measured[max(late, 0) : len(measured) + min(late, 0)],
        predicted[max(-late, 0) : len(predicted) - max(late, 0)],
    )
    power = pairs[0][np.argsort(pairs[1], kind="stable")]
    return float(np.mean((power - isotonic_regression(power).x) ** 2) / max(power.var(), 1e-12))


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


def _smoother(slow: list[_Fit], fast: list[_Fit]) -> _Smoothing:
    """What smooths the power of `slow` and not that of `fast`; `_NOTHING` where both are alike.

    The errors of `slow` have to be larger than those of unchanged recordings would be. As for a delay, wrong columns
    gain something, too; and a meter that cuts off the peaks loses fast power without any smoothing.
    """
    gains, other = (np.median([np.log(fit.left / fit.left[0]) for fit in fits], axis=0) for fits in (slow, fast))
    best = int(gains.argmin())
    curve = float(np.median([np.log(max(fit.by_a_curve, 1e-12) / fit.left[0]) for fit in slow]))
    beyond = np.exp(min(float(other[best]), curve, 0.0)) - np.exp(gains[best])
    if beyond > THRESHOLDS.column_error and grown([fit.error for fit in fast], [fit.error for fit in slow]):
        return _SMOOTHINGS[best]
    return _NOTHING


def _restored(segment: Segment, predicted: Floats, smoothing: _Smoothing) -> Segment:
    """With the fast part of the predicted power [T] W, as late as the power is."""
    fast = predicted - smoothing.of(predicted)
    late = _fit(predicted, segment.P).late[_SMOOTHINGS.index(smoothing)] if len(fast) > _REACH else 0.0
    t = np.arange(len(fast), dtype=np.float64)
    return replace(segment, P=segment.P + np.interp(t - late, t, fast))
