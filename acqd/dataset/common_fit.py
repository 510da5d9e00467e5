"""One regression of the power of many recordings on their motion, together with the lag of every recording.

A single recording has too few independent seconds for the regression's many weights: its own lag scatters by ten
milliseconds. The weights are properties of the robot. All recordings share them, and each keeps its own lag and its
own mean power. Gauss-Newton steps find both. Tukey's biweight ignores rows that motion does not explain, such as
brakes that the log does not mention.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.dataset.align import Overlap
from acqd.dataset.regressors import STEP_S
from acqd.numerics import BIWEIGHT_END, biweight, mad_sigma

_RIDGE = 1e-6  # of the rows: columns may be collinear
_LONGEST_STEP_S = 0.03
_CONVERGED_S = 2e-4
_HIGH_PASS_S = 0.3
"""Time constant of the high-pass that removes slow changes of the standby power: no motion explains them."""
_MEMORY_ROWS = 100  # over which an autocorrelation is summed at most
_LEAST_W = 1e-3


class Part(NamedTuple):
    """One recording at one lag, without slow changes."""

    X: Floats
    """[N, k]."""
    y: Floats
    """[N] W."""
    slope: Floats
    """[N] W/s: change of the predicted power with the lag."""


class Share(NamedTuple):
    """What one recording contributes to the normal equations of the weights."""

    gram: Floats
    right: Floats


@dataclass(frozen=True, slots=True)
class CommonFit:
    """Weights of the regression, and the lags of the recordings that it was fitted to."""

    weights: Floats
    """[k] W per unit of each regressor."""
    lags_s: Floats
    """[n] controller clock minus power clock."""
    residual: Floats
    """[rows] W, of all recordings one after another."""
    scale_W: float
    """Standard deviation of the residual, by its median absolute deviation."""
    inflation: float
    """Factor by which the residual's autocorrelation multiplies the variance of a mean."""
    shares: list[Share]

    def weights_without(self, left_out: list[int]) -> Floats:
        """[k] weights of the other recordings, at their present lags."""
        kept = [share for k, share in enumerate(self.shares) if k not in left_out]
        gram = np.sum([share.gram for share in kept], axis=0)
        return _ridge(gram, np.sum([share.right for share in kept], axis=0))


def fit_common(overlaps: list[Overlap], lags_s: Floats, weights: Floats | None, steps: int) -> CommonFit:
    """Fits weights and lags [n] by at most `steps` steps from `lags_s` and, if given, `weights`."""
    size = min(overlap.columns.shape[1] for overlap in overlaps)
    lags = np.array(lags_s, dtype=np.float64)
    if weights is None:
        shares = [_share(part_at(o, lag, np.zeros(size)), np.inf) for o, lag in zip(overlaps, lags, strict=True)]
        weights = _ridge(np.sum([share.gram for share in shares], axis=0), np.sum([s.right for s in shares], axis=0))
    for _ in range(steps):
        parts = [part_at(o, lag, weights) for o, lag in zip(overlaps, lags, strict=True)]
        change, moved = _gauss_newton(parts, weights)
        weights = weights + change
        lags += np.clip(moved, -_LONGEST_STEP_S, _LONGEST_STEP_S)
        if np.abs(moved).max() < _CONVERGED_S:
            break
    parts = [part_at(o, lag, weights) for o, lag in zip(overlaps, lags, strict=True)]
    residuals = [part.y - part.X @ weights for part in parts]
    scale_W = scale_of(residuals)
    shares = [_share(part, scale_W, residual) for part, residual in zip(parts, residuals, strict=True)]
    limit = BIWEIGHT_END * scale_W
    memory = autocorrelation([np.clip(residual, -limit, limit) for residual in residuals])
    inflation = max(1.0, 1 + 2 * float(memory[1:].sum()))
    return CommonFit(weights, lags, np.concatenate(residuals), scale_W, inflation, shares)


def part_at(overlap: Overlap, lag_s: float, weights: Floats) -> Part:
    """A recording at a lag, with the first columns for which there are weights."""
    X, y = overlap.shifted(lag_s)
    predicted = overlap.columns[:, : len(weights)] @ weights.astype(np.float32)  # gives the direction of a step only
    slope = np.interp(overlap.at + lag_s, overlap.t, np.gradient(predicted, STEP_S))
    step_s = float(np.median(np.diff(overlap.at)))
    return Part(*(without_slow(values, step_s) for values in (X[:, : len(weights)], y, slope)))


def without_slow(values: Floats, step_s: float) -> Floats:
    """First-order high-pass along the first axis; the same for both sides of the regression, so edges do no harm."""
    keep = float(np.exp(-step_s / _HIGH_PASS_S))
    gain = (1 + keep) / 2
    filtered, _ = lfilter([gain, -gain], [1.0, -keep], values, axis=0, zi=-gain * values[:1])
    return np.asarray(filtered - filtered.mean(axis=0))


def scale_of(residuals: list[Floats]) -> float:
    """Standard deviation (W) by the median absolute deviation."""
    return max(mad_sigma(np.concatenate(residuals), 0.0), _LEAST_W)


def autocorrelation(series: list[Floats], *, whole: bool = False) -> Floats:
    """[rows] autocorrelation pooled over all series, 0 from where it first is negative unless the `whole` is asked."""
    total = np.zeros(_MEMORY_ROWS)
    for values in series:
        size = 2 ** int(np.ceil(np.log2(2 * len(values))))
        own = np.fft.irfft(np.abs(np.fft.rfft(values, size)) ** 2, size)[: min(_MEMORY_ROWS, len(values))]
        total[: len(own)] += own
    total /= max(float(total[0]), 1e-12)
    negative = np.flatnonzero(total <= 0)
    if len(negative) and not whole:
        total[negative[0] :] = 0.0
    return total


def _share(part: Part, scale_W: float, residual: Floats | None = None) -> Share:
    trust = np.ones(len(part.y)) if residual is None else biweight(residual, scale_W)
    weighted = part.X * trust[:, None]
    return Share(weighted.T @ part.X, weighted.T @ part.y)


def _ridge(gram: Floats, right: Floats) -> Floats:
    unit = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    scaled = gram / np.outer(unit, unit)
    scaled[np.diag_indices_from(scaled)] += _RIDGE
    return np.asarray(np.linalg.solve(scaled, right / unit) / unit)


def _gauss_newton(parts: list[Part], weights: Floats) -> tuple[Floats, Floats]:
    """Changes of weights [k] and lags [n] by least squares in both; a Schur complement eliminates the lags."""
    residuals = [part.y - part.X @ weights for part in parts]
    scale_W = scale_of(residuals)
    size = len(weights)
    gram, right = np.zeros((size, size)), np.zeros(size)
    crossed, own, pull = np.zeros((len(parts), size)), np.zeros(len(parts)), np.zeros(len(parts))
    for k, (part, residual) in enumerate(zip(parts, residuals, strict=True)):
        trust = biweight(residual, scale_W)
        weighted = part.X * trust[:, None]
        gram += weighted.T @ part.X
        right += weighted.T @ residual
        crossed[k] = weighted.T @ part.slope
        own[k] = max(float(trust @ (part.slope * part.slope)), 1e-9)
        pull[k] = float(trust @ (part.slope * residual))
    reduced = gram - (crossed / own[:, None]).T @ crossed
    unit = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    scaled = reduced / np.outer(unit, unit)
    scaled[np.diag_indices_from(scaled)] += _RIDGE
    penalty = _RIDGE * unit * unit * weights  # the ridge holds for the weights, not for their change
    change = np.linalg.solve(scaled, (right - crossed.T @ (pull / own) - penalty) / unit) / unit
    return change, (pull - crossed @ change) / own
