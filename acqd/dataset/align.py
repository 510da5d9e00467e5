"""The time shift between a robot's log and the power stream: coarse search, refinement, and how sure it is.

A lag is controller clock minus power clock. For every candidate the metered power is regressed on the log's
quantities (see explain.py); the explained share R^2 is what is maximised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr
from scipy.optimize import minimize_scalar
from scipy.signal import correlate

from acqd.dataset.explain import STEP_S, Explanation
from acqd.dataset.power import PowerStream
from acqd.robot.description import Floats

SEARCH_S = 2.4
"""Half the range that the thesis searches (section 6.3)."""
_RHO = 0.5  # neighbouring residuals are alike: half-differencing whitens them enough to sharpen the maximum
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
    X = _orthonormal(_every(about.as_metered(supply_lag_s, step), step))
    begin = about.start_s - centre_s - half_s
    count = len(X) + int(2 * half_s / step) + 1
    P = _even(power, begin, count, step)
    if P is None or len(P) < len(X):
        return None
    r2 = _r2_over_lags(X, P)
    best = int(np.argmax(r2))
    away = np.abs(np.arange(len(r2)) - best) * step > _EXCLUDED_S
    runner_up = float(r2[away].max()) if away.any() else 0.0
    lag = centre_s + half_s - best * step
    ratio = (1 - runner_up) / max(1 - float(r2[best]), 1e-9)
    return Lag(lag, float(r2[best]), ratio)


def refine(about: Explanation, power: PowerStream, supply_lag_s: float, coarse: Lag) -> Lag:
    """The lag between the grid's points."""
    window_s = power.window_ns * 1e-9
    columns = about.as_metered(supply_lag_s, window_s)
    t = about.t

    def unexplained(lag: float) -> float:
        return _unexplained(t, columns, power, lag)

    span = 1.5 * window_s
    found = minimize_scalar(
        unexplained, bounds=(coarse.seconds - span, coarse.seconds + span), method="bounded", options={"xatol": 1e-4}
    )
    return Lag(float(found.x), 1 - float(found.fun), coarse.ratio)


def _unexplained(t: Floats, columns: Floats, power: PowerStream, lag: float) -> float:
    """Unexplained share of the half-differenced power's variance."""
    half_window = power.window_ns * 0.5e-9
    edge = 0.2
    rows = power.part(round((t[0] + edge - lag - half_window) * 1e9), round((t[-1] - edge - lag - half_window) * 1e9))
    centres = power.time_ns[rows] * 1e-9 + half_window + lag
    P = power.P[rows]
    known = np.isfinite(P)
    X = np.column_stack([np.interp(centres[known], t, column) for column in columns.T] + [np.ones(known.sum())])
    y = P[known]
    if len(y) < 2 * X.shape[1]:
        return 1.0
    X, y = X[1:] - _RHO * X[:-1], y[1:] - _RHO * y[:-1]
    X = X / np.maximum(np.sqrt((X * X).mean(axis=0)), 1e-12)
    gram = X.T @ X
    gram[np.diag_indices_from(gram)] += 1e-7 * len(y)  # columns may say the same
    solution = np.linalg.solve(gram, X.T @ y)
    return float((y - X @ solution).var() / max(y.var(), 1e-12))


def _every(columns: Floats, step: float) -> Floats:
    """Rows `step` seconds apart."""
    return columns[:: max(1, round(step / STEP_S))]


def _orthonormal(X: Floats) -> Floats:
    """Centred columns as an orthonormal basis of what they span."""
    X = X - X.mean(axis=0)
    scale = X.std(axis=0)
    X = X[:, scale > 1e-12] / scale[scale > 1e-12]
    basis, triangle, _ = qr(X, mode="economic", pivoting=True)
    kept = np.abs(np.diag(triangle)) > 1e-6 * np.abs(triangle[0, 0])
    return np.asarray(basis[:, kept])


def _even(power: PowerStream, begin_s: float, count: int, step: float) -> Floats | None:
    """[count] power at even times from `begin_s`, its ends held beyond the stream; None when it lies elsewhere."""
    grid = begin_s + step * np.arange(count)
    rows = power.part(round((grid[0] - 1) * 1e9), round((grid[-1] + 1) * 1e9))
    P = np.asarray(power.P[rows])
    known = np.isfinite(P)
    if known.sum() < 50:
        return None
    centres = power.time_ns[rows][known] * 1e-9 + 0.5 * step
    return np.asarray(np.interp(grid, centres, P[known]))


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
