"""Resamples values at uneven times to an even grid, linearly; values faster than the grid are averaged first."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.robot.labels import Texts

_LEAST_SHARE = 1e-3
"""Of a step: the value itself stands for the mean over less."""


def resampled(grid: Floats, t: Floats, values: Floats, step_s: float) -> Floats:
    """[len(grid)] values on the grid, from values at rising times `t` (s); NaN are skipped."""
    known = np.isfinite(values)
    if known.sum() < 2:
        return np.full(len(grid), np.nan)
    t, values = t[known], values[known]
    if np.median(np.diff(t)) < 0.6 * step_s:  # the mean over each step, by the integral of the straight lines
        integral = np.concatenate([[0.0], np.cumsum(np.diff(t) * (values[1:] + values[:-1]) / 2)])
        within = np.clip(grid, t[0], t[-1])
        # narrower at the ends, but even there about the grid point: half a window would be the mean of another time
        half = np.minimum(step_s / 2, np.minimum(within - t[0], t[-1] - within))
        low, high = (_integral_at(within + side * half, t, values, integral) for side in (-1, 1))
        lone = half < _LEAST_SHARE * step_s
        means = (high - low) / np.where(lone, 1.0, 2 * half)
        return np.asarray(np.where(lone, np.interp(within, t, values), means))
    return np.asarray(np.interp(grid, t, values))


def held(grid: Floats, t: Floats, values: Texts) -> Texts:
    """[len(grid)] labels that hold from their times `t` (rising) until the next one; the first also before."""
    return values[np.maximum(np.searchsorted(t, grid, side="right") - 1, 0)]


def _integral_at(at: Floats, t: Floats, values: Floats, integral: Floats) -> Floats:
    before = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    elapsed = at - t[before]
    slope = (values[before + 1] - values[before]) / (t[before + 1] - t[before])
    return np.asarray(integral[before] + elapsed * (values[before] + slope * elapsed / 2))
