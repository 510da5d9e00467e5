"""The time shift between a robot's log and the power stream: coarse search, refinement, and how sure it is.

A lag is controller clock minus power clock. For every candidate the metered power is regressed on the log's
quantities (see explain.py); the explained share R^2 is what is maximised.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.optimize import minimize_scalar
from scipy.signal import correlate

from acqd.arrays import Floats
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Explanation, band_limited
from acqd.numerics import ridge_regression

Bools: TypeAlias = NDArray[np.bool_]

SEARCH_S = 2.4
"""Half the range that the thesis searches (section 6.3)."""
_COVERED = 0.8
_EDGE_S = 0.5  # of a log: there its smoothing is not to be trusted
_SPAN = 1.5  # windows to either side within which a coarse lag is refined
_EXCLUDED_S = 0.5  # around the maximum: where its own flank lies
_LEAST_R2 = 0.2
_LEAST_RATIO = 1.3  # of unexplained variance, runner-up to best


@dataclass(frozen=True, slots=True)
class Lag:
    """What one recording says about its lag."""

    seconds: float
    """Controller clock minus power clock."""
    r2: float
    """Explained share of the power's variance at the maximum."""
    ratio: float
    """Unexplained variance of the best other lag over that of this one: how far it stands out."""

    @property
    def credible(self) -> bool:
        """Whether the maximum is high and stands out."""
        return self.r2 >= _LEAST_R2 and self.ratio >= _LEAST_RATIO


def coarse_search(
    about: Explanation, power: PowerStream, supply_lag_s: float, centre_s: float, half_s: float
) -> Lag | None:
    """The best lag within `half_s` around `centre_s` on the grid of the power rows; None without overlap."""
    step = power.window_ns * 1e-9
    X = _orthonormal(_every(about.as_metered(supply_lag_s, step)[:, about.searched], step))
    if not X.shape[1]:
        return None  # it stood still
    begin = about.start_s - centre_s - half_s
    count = len(X) + int(2 * half_s / step) + 1
    even = _even(power, begin, count, step)
    if even is None or count < len(X):
        return None
    r2 = _r2_over_lags(X, even[1])
    rows = np.concatenate([[0], np.cumsum(even[2])])
    r2[rows[len(X) :] - rows[: -len(X)] < _COVERED * len(X)] = 0.0  # most of a log must have power beside it
    best = int(np.argmax(r2))
    away = np.abs(np.arange(len(r2)) - best) * step > _EXCLUDED_S
    runner_up = float(r2[away].max()) if away.any() else 0.0
    lag = centre_s + half_s - best * step
    ratio = (1 - runner_up) / max(1 - float(r2[best]), 1e-9)
    if min(best, len(r2) - 1 - best) * step < _EXCLUDED_S:
        ratio = 1.0  # the flank of a maximum that lies outside
    return Lag(lag, float(r2[best]), ratio)


@dataclass(frozen=True, slots=True)
class Overlap:
    """A recording's quantities beside the power, below BAND_HZ, ready to be shifted against each other."""

    t: Floats
    """[T] s, controller time."""
    columns: Floats
    """[T, k] as the meter would see them."""
    at: Floats
    """[N] s, power clock."""
    P: Floats
    """[N] W."""

    def shifted(self, lag_s: float) -> tuple[Floats, Floats]:
        """Quantities [N, k] and power [N], both centred, were the controller's clock `lag_s` ahead."""
        X = _between(self.columns, (self.at + lag_s - self.t[0]) / STEP_S)
        return X - X.mean(axis=0), self.P - self.P.mean()


def overlap(about: Explanation, power: PowerStream, supply_lag_s: float, coarse: Lag) -> Overlap | None:
    """What both sides know at about the coarse lag; None when that is too little."""
    window_s = power.window_ns * 1e-9
    t, span = about.t, _SPAN * window_s
    count = int((t[-1] - t[0] + 2 * span) / window_s)
    even = _even(power, t[0] - coarse.seconds - span, count, window_s)
    if even is None:
        return None
    at, P, known = even
    inside = known & (at + coarse.seconds > t[0] + _EDGE_S) & (at + coarse.seconds < t[-1] - _EDGE_S)
    if inside.sum() < 2 * about.columns.shape[1]:
        return None
    columns = band_limited(about.as_metered(supply_lag_s, window_s), STEP_S)
    return Overlap(t, columns, at[inside], band_limited(P, window_s)[inside])


def refine(about: Explanation, power: PowerStream, supply_lag_s: float, coarse: Lag) -> Lag:
    """The lag between the grid's points, from what both sides have in common below BAND_HZ."""
    both = overlap(about, power, supply_lag_s, coarse)
    if both is None:
        return coarse
    span = _SPAN * power.window_ns * 1e-9
    bounds = (coarse.seconds - span, coarse.seconds + span)
    found = minimize_scalar(
        lambda lag: unexplained(*both.shifted(lag)), bounds=bounds, method="bounded", options={"xatol": 1e-4}
    )
    return Lag(float(found.x), 1 - float(found.fun), coarse.ratio)


def unexplained(X: Floats, y: Floats) -> float:
    """Share of the variance of `y` that its regression on `X` leaves, both centred."""
    weights = ridge_regression(X, y, 1e-7)  # the ridge: columns may be collinear
    return float((y - X @ weights).var() / max(y.var(), 1e-12))


def _every(columns: Floats, step: float) -> Floats:
    """Rows `step` seconds apart, whatever the grid's step is."""
    return _between(columns, np.arange(0, (len(columns) - 1) * STEP_S, step) / STEP_S)


def _between(columns: Floats, place: Floats) -> Floats:
    """Rows at places that are no whole numbers."""
    before = np.clip(place.astype(np.int64), 0, len(columns) - 2)
    share = np.clip(place - before, 0.0, 1.0)[:, None]
    return np.asarray(columns[before] * (1 - share) + columns[before + 1] * share)


def _orthonormal(X: Floats) -> Floats:
    """Centred columns as an orthonormal basis of what they span."""
    X = X - X.mean(axis=0)
    scale = X.std(axis=0)
    X = X[:, scale > 1e-12] / scale[scale > 1e-12]
    if not X.shape[1]:
        return X
    basis, triangle, _ = qr(X, mode="economic", pivoting=True)
    kept = np.abs(np.diag(triangle)) > 1e-6 * np.abs(triangle[0, 0])
    return np.asarray(basis[:, kept])


def _even(power: PowerStream, begin_s: float, count: int, step: float) -> tuple[Floats, Floats, Bools] | None:
    """[count] even times from `begin_s`, the power there, and whether a row is near; None without enough rows.

    The stream's ends are held beyond it.
    """
    grid = begin_s + step * np.arange(count)
    rows = power.part(round((grid[0] - 1) * 1e9), round((grid[-1] + 1) * 1e9))
    P = np.asarray(power.P[rows])
    known = np.isfinite(P)
    if known.sum() < 50:
        return None
    centres = np.asarray(power.time_ns[rows][known] * 1e-9 + 0.5 * step)
    after = np.clip(np.searchsorted(centres, grid), 1, len(centres) - 1)
    near: Bools = np.asarray(np.minimum(np.abs(centres[after] - grid), np.abs(grid - centres[after - 1])) <= step)
    return np.asarray(grid), np.asarray(np.interp(grid, centres, P[known])), near


def _r2_over_lags(X: Floats, P: Floats) -> Floats:
    """R^2 of the regression of P[k : k + len(X)] on X and a constant, for every k; X is orthonormal and centred."""
    length = len(X)
    P = P - P.mean()
    explained = sum(correlate(P, column, mode="valid", method="fft") ** 2 for column in X.T)
    sums = np.concatenate([[0.0], np.cumsum(P)])
    squares = np.concatenate([[0.0], np.cumsum(P**2)])
    mean = (sums[length:] - sums[:-length]) / length
    total = squares[length:] - squares[:-length] - length * mean**2
    return np.asarray(np.where(total > 1e-9 * length, explained / np.maximum(total, 1e-12), 0.0))
