"""Small numerical methods that several rooms need: robust spread, slope and loss, runs of True, ridge solve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

_NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation: 1 / Phi^-1(3/4)."""
NORMAL_95 = 1.96
"""Half the width of a 95 % interval, in standard errors."""
BIWEIGHT_END = 4.685
"""Standard deviations beyond which Tukey's biweight is 0: 95 % efficiency for normal values (Huber 1981)."""


def mad_sigma(values: Floats, centre: float | None = None) -> float:
    """Standard deviation by the median absolute deviation about `centre` (None: the median), for normal values.

    Robust: half of the values may be outliers (Hampel 1974).
    """
    if centre is None:
        centre = float(np.median(values))
    return float(_NORMAL * np.median(np.abs(values - centre)))


def theil_sen_slope(t: Floats, values: Floats, least_apart: float) -> float:
    """Median slope of all pairs more than `least_apart` apart in `t` (Theil 1950, Sen 1968); 0 without such a pair."""
    first, second = np.triu_indices(len(t), 1)
    distance = t[second] - t[first]
    chosen = np.abs(distance) > least_apart
    return float(np.median((values[second] - values[first])[chosen] / distance[chosen])) if chosen.any() else 0.0


def biweight(residual: Floats, scale: Floats | float) -> Floats:
    """Tukey's weight of each value: 1 near 0, 0 beyond 4.7 standard deviations."""
    return np.asarray(np.maximum(1 - (residual / (BIWEIGHT_END * scale)) ** 2, 0.0) ** 2)


def biweight_loss(residual: Floats, scale: Floats | float) -> float:
    """Sum of Tukey's loss: like (residual / scale)^2 near 0, constant beyond 4.7 standard deviations."""
    share = np.minimum((residual / (BIWEIGHT_END * scale)) ** 2, 1.0)
    return float(BIWEIGHT_END**2 / 3 * (1 - (1 - share) ** 3).sum())


def runs_of_true(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row, and the row after the last, of every unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def solve_scaled_ridge(A: Floats, b: Floats, ridge: float) -> Floats:
    """Solve A x = b for a normal matrix A: scaled to a unit diagonal, then `ridge` added to the diagonal."""
    scale = np.sqrt(np.maximum(np.diag(A), 1e-12))
    scaled = A / np.outer(scale, scale)
    scaled[np.diag_indices(len(A))] += ridge
    return np.asarray(np.linalg.solve(scaled, b / scale) / scale)


def ridge_regression(X: Floats, y: Floats, ridge: float) -> Floats:
    """Ridge regression of y [n] on X [n, k]: weights [k]; columns are scaled to unit RMS, the penalty is `ridge` n."""
    scale = np.maximum(np.sqrt((X * X).mean(axis=0)), 1e-12)
    scaled = X / scale
    gram = scaled.T @ scaled
    gram[np.diag_indices_from(gram)] += ridge * len(y)
    return np.asarray(np.linalg.solve(gram, scaled.T @ y) / scale)


def quadratic_form(V: Floats, u: Floats, tolerance: float = 1e-9) -> tuple[Floats, int]:
    """u' V^+ u for every row of u [..., k], and the rank of the covariance V [k, k].

    The pseudoinverse (Moore-Penrose) of V scaled to a unit diagonal: directions in which nothing varies do not count.
    """
    scale = np.sqrt(np.maximum(np.diag(V), 1e-300))
    values, vectors = np.linalg.eigh(V / np.outer(scale, scale))
    kept = values > tolerance * max(float(values[-1]), 1e-300)
    turned = (u / scale) @ vectors[:, kept]
    return np.asarray((turned**2 / values[kept]).sum(axis=-1)), int(kept.sum())


def running_line(time: Floats, index: Floats, reach: int, row_s: float) -> Floats:
    """[T] value at each row of the straight line of stamps over row numbers [T] of the rows within `reach` numbers."""
    index = index - index[0]
    off = time - time[0] - row_s * index
    first, last = np.searchsorted(index, index - reach), np.searchsorted(index, index + reach, side="right")
    sums = [np.concatenate([[0.0], np.cumsum(each)]) for each in (index * 0 + 1, index, index**2, off, off * index)]
    n, s1, s2, t0, t1 = (each[last] - each[first] for each in sums)
    spread = n * s2 - s1**2
    slope = np.where(spread > 0.5, (n * t1 - s1 * t0) / np.maximum(spread, 0.5), 0.0)
    return np.asarray(time[0] + row_s * index + (t0 - slope * s1) / n + slope * index)
