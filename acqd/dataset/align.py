"""The lag of one robot log against the power stream: coarse search, refinement, credibility.

A lag is controller clock minus power clock. For every candidate lag the metered power is regressed on the log's
regressors (see regressors.py); the lag with the largest share of explained variance R^2 wins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.optimize import minimize_scalar
from scipy.signal import correlate

from acqd.arrays import Floats, Singles
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Regressors, band_limited, behind_supply
from acqd.numerics import ridge_regression

Bools: TypeAlias = NDArray[np.bool_]

SEARCH_S = 2.4
"""Half the range that the thesis searches (section 6.3)."""
_MIN_OVERLAP = 0.8  # share of the log's rows that must have power
_MIN_POWER_ROWS = 50
_EDGE_S = 0.5  # at either end of a log the smoothing filter is not settled
_SPAN = 1.5  # windows on either side of the coarse lag that the refinement searches
_FLANK_S = 0.5  # around the maximum of R^2: other lags within are its own flank
MIN_R2 = 0.2
_MIN_RATIO = 1.3  # unexplained variance of the best other lag over the best lag's


@dataclass(frozen=True, slots=True)
class Lag:
    """Lag of one recording, estimated from that recording only."""

    seconds: float
    """Controller clock minus power clock."""
    r2: float
    """Explained share of the power's variance at the maximum."""
    ratio: float
    """Unexplained variance at the best other lag over the unexplained variance at this lag."""
    error_s: float = 0.0075
    """Standard error; by default what lags of single recordings scatter by without torque sensors."""

    @property
    def credible(self) -> bool:
        """Whether the maximum of R^2 is high enough and unique enough."""
        return self.r2 >= MIN_R2 and self.ratio >= _MIN_RATIO


def coarse_search(
    regressors: Regressors, power: PowerStream, supply_lag_s: float, centre_s: float, half_s: float
) -> Lag | None:
    """The best lag within `centre_s` +- `half_s` on the grid of the power rows; None without overlap or motion."""
    step = power.window_ns * 1e-9
    X = _orthonormal(_thinned(regressors.as_metered(supply_lag_s, step)[:, regressors.searched], step))
    if not X.shape[1]:
        return None  # the robot stood still
    start_s = regressors.start_s - centre_s - half_s
    count = len(X) + int(2 * half_s / step) + 1
    on_grid = _power_on_grid(power, start_s, count, step)
    if on_grid is None or count < len(X):
        return None
    _, P, known = on_grid
    r2 = _r2_over_lags(X, P)
    known_rows = np.concatenate([[0], np.cumsum(known)])
    r2[known_rows[len(X) :] - known_rows[: -len(X)] < _MIN_OVERLAP * len(X)] = 0.0
    best = int(np.argmax(r2))
    others = np.abs(np.arange(len(r2)) - best) * step > _FLANK_S
    runner_up = float(r2[others].max()) if others.any() else 0.0
    lag = centre_s + half_s - best * step
    ratio = (1 - runner_up) / max(1 - float(r2[best]), 1e-9)
    if min(best, len(r2) - 1 - best) * step < _FLANK_S:
        ratio = 1.0  # at the edge of the range: the flank of a maximum outside it
    return Lag(lag, float(r2[best]), ratio)


@dataclass(frozen=True, slots=True)
class Overlap:
    """A recording's regressors and the power of the same time, both below BAND_HZ, ready to be shifted."""

    t: Floats
    """[T] s, controller clock."""
    columns: Singles
    """[T, k] regressors as the meter would see them."""
    at: Floats
    """[N] s, power clock."""
    P: Floats
    """[N] W."""

    def shifted(self, lag_s: float) -> tuple[Floats, Floats]:
        """Regressors [N, k] at the lag `lag_s` and power [N], both centred."""
        X = _interpolated(self.columns, (self.at + lag_s - self.t[0]) / STEP_S)
        return X - X.mean(axis=0), self.P - self.P.mean()

    def behind_supply(self, lag_s: float) -> Overlap:
        """The same with regressors delayed by a supply; at the log's start, they are taken as constant before."""
        delayed = behind_supply(self.columns.astype(np.float64), lag_s)
        return replace(self, columns=delayed.astype(np.float32))


def overlap(
    regressors: Regressors, power: PowerStream, supply_lag_s: float, coarse: Lag, average_s: float = 0.0
) -> Overlap | None:
    """What log and stream have in common near the coarse lag; None when that is too little for a regression.

    `average_s`: time over which the meter averages, if that is longer than the time between its rows.
    """
    window_s = power.window_ns * 1e-9
    t, span = regressors.t, _SPAN * window_s
    count = int((t[-1] - t[0] + 2 * span) / window_s)
    start_s = _on_a_row(power, t[0] - coarse.seconds - span)
    on_grid = _power_on_grid(power, start_s, count, window_s)
    if on_grid is None:
        return None
    at, P, known = on_grid
    inside = known & (at + coarse.seconds > t[0] + _EDGE_S) & (at + coarse.seconds < t[-1] - _EDGE_S)
    if regressors.known is not None:
        row = np.rint((at + coarse.seconds - t[0]) / STEP_S).astype(np.int64)
        inside &= regressors.known[np.clip(row, 0, len(t) - 1)]
    if inside.sum() < 2 * regressors.columns.shape[1]:
        return None
    columns = band_limited(regressors.as_metered(supply_lag_s, max(window_s, average_s)), STEP_S)
    return Overlap(t, columns.astype(np.float32), at[inside], band_limited(P, window_s)[inside])


def refine(regressors: Regressors, power: PowerStream, supply_lag_s: float, coarse: Lag) -> Lag:
    """The continuous maximum of R^2 near a coarse lag, from regressors and power below BAND_HZ."""
    common = overlap(regressors, power, supply_lag_s, coarse)
    if common is None:
        return coarse
    span = _SPAN * power.window_ns * 1e-9
    bounds = (coarse.seconds - span, coarse.seconds + span)
    minimum = minimize_scalar(
        lambda lag: unexplained(*common.shifted(lag)), bounds=bounds, method="bounded", options={"xatol": 1e-4}
    )
    return Lag(float(minimum.x), 1 - float(minimum.fun), coarse.ratio)


def unexplained(X: Floats, y: Floats) -> float:
    """Share of the variance of `y` that its regression on `X` leaves; both are centred."""
    weights = ridge_regression(X, y, 1e-7)  # the ridge: columns may be collinear
    return float((y - X @ weights).var() / max(y.var(), 1e-12))


def _thinned(columns: Floats, step: float) -> Floats:
    """Rows `step` seconds apart instead of STEP_S."""
    return _interpolated(columns, np.arange(0, (len(columns) - 1) * STEP_S, step) / STEP_S)


def _interpolated(columns: Floats | Singles, index: Floats) -> Floats:
    """Rows at fractional indices, by cubics through four neighbours: straight lines would blur."""
    before = np.clip(index.astype(np.int64), 1, len(columns) - 3)
    x = np.clip(index - before, -1.0, 2.0)[:, None]
    shares = (
        -x * (x - 1) * (x - 2) / 6,
        (x + 1) * (x - 1) * (x - 2) / 2,
        -(x + 1) * x * (x - 2) / 2,
        (x + 1) * x * (x - 1) / 6,
    )
    result, neighbour = (
        np.zeros((len(index), columns.shape[1])),
        np.empty((len(index), columns.shape[1]), columns.dtype),
    )
    for k, share in enumerate(shares):  # without arrays in between: a search for a lag does this a hundred times
        np.take(columns, before + k - 1, axis=0, out=neighbour, mode="clip")
        neighbour *= share
        result += neighbour
    return result


def _orthonormal(X: Floats) -> Floats:
    """Orthonormal basis of the centred columns' span, by QR decomposition with column pivoting."""
    X = X - X.mean(axis=0)
    scale = X.std(axis=0)
    X = X[:, scale > 1e-12] / scale[scale > 1e-12]
    if not X.shape[1]:
        return X
    basis, triangle, _ = qr(X, mode="economic", pivoting=True)
    kept = np.abs(np.diag(triangle)) > 1e-6 * np.abs(triangle[0, 0])
    return np.asarray(basis[:, kept])


def _power_on_grid(power: PowerStream, start_s: float, count: int, step: float) -> tuple[Floats, Floats, Bools] | None:
    """[count] even times from `start_s`, power at them, and whether a power row is near; None with too few rows.

    Beyond the ends of the stream, its first and last values are held.
    """
    grid = start_s + step * np.arange(count)
    rows = power.part(round((grid[0] - 1) * 1e9), round((grid[-1] + 1) * 1e9))
    P = np.asarray(power.P[rows])
    known = np.isfinite(P)
    if known.sum() < _MIN_POWER_ROWS:
        return None
    centres = np.asarray(power.time_ns[rows][known] * 1e-9 + 0.5 * step)
    after = np.clip(np.searchsorted(centres, grid), 1, len(centres) - 1)
    near: Bools = np.asarray(np.minimum(np.abs(centres[after] - grid), np.abs(grid - centres[after - 1])) <= step)
    return np.asarray(grid), np.asarray(np.interp(grid, centres, P[known])), near


def _on_a_row(power: PowerStream, time_s: float) -> float:
    """The middle of the first window after `time_s`.

    Power read off between rows by straight lines would be smoothed as by a supply's lag of up to half a window.
    """
    half_ns = power.window_ns // 2
    row = int(np.searchsorted(power.time_ns, round(time_s * 1e9) - half_ns))
    return float(power.time_ns[row] + half_ns) * 1e-9 if row < len(power.time_ns) else time_s


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
