"""The supply's first-order lag: mains power follows the robot's power later, which would look like a clock offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from acqd.arrays import Floats
from acqd.dataset.align import Lag, Overlap, overlap, unexplained
from acqd.dataset.clock_line import fit_line
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Regressors
from acqd.numerics import ridge_regression

USUAL_LAG_S = 0.015
"""Lag of a usual supply: its bulk capacitor delays by most of a mains period."""
_SPREAD_S = 0.01
# Share of the unexplained variance that must vanish before a supply one spread off the usual one is accepted. Less is
# within the error of the regression itself, and a wrong supply lag shifts every recording by the same amount.
_WORTH = 0.05
_CANDIDATES_S = (0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05)
_MAX_RECORDINGS = 24
_MIN_RECORDINGS = 3


def supply_lag(regressors: list[Regressors], power: PowerStream, lags: list[Lag]) -> tuple[float, float]:
    """The supply's lag [s], and by how much [s] it shifts all `lags`, which were refined for the usual supply.

    One regression of up to 24 recordings together, at the lags of their clock line. A single recording has too few
    independent seconds for so many regressors and fits a wrong supply nearly as well.
    """
    chosen = _chosen(lags)
    middles = np.array([regressors[k].start_s + len(regressors[k].columns) * STEP_S / 2 for k in chosen])
    line = fit_line(middles, [lags[k] for k in chosen])
    placed = [float(line.at(t)) if line else lags[k].seconds for k, t in zip(chosen, middles, strict=True)]
    shifts = np.zeros(len(_CANDIDATES_S))
    cost = np.zeros(len(_CANDIDATES_S))
    for number, candidate in enumerate(_CANDIDATES_S):
        overlaps = [overlap(regressors[k], power, candidate, lags[k]) for k in chosen]
        pairs = [(common, lag) for common, lag in zip(overlaps, placed, strict=True) if common is not None]
        if not pairs:
            return USUAL_LAG_S, 0.0
        expected = candidate - USUAL_LAG_S
        best = minimize_scalar(
            lambda shift, pairs=pairs: _pooled(pairs, shift),
            bounds=(expected - 0.02, expected + 0.02),
            method="bounded",
            options={"xatol": 5e-4},
        )
        shifts[number] = best.x
        cost[number] = np.log(best.fun + 1e-9) + _WORTH * (expected / _SPREAD_S) ** 2
    lag = _minimum(cost)
    return lag, float(np.interp(lag, _CANDIDATES_S, shifts))


@dataclass(frozen=True, slots=True)
class Regression:
    """Regression of the power on the motion, fitted to all credible recordings together."""

    weights: Floats
    """[k] W per unit of each regressor."""
    rest_W: float
    """RMS of its residual in these recordings."""

    def rest(self, X: Floats, y: Floats) -> float:
        """RMS (W) of its residual in another recording; regressors and power are centred."""
        kept = min(len(self.weights), X.shape[1])
        return float((y - X[:, :kept] @ self.weights[:kept]).std())


def common_regression(regressors: list[Regressors], power: PowerStream, lags: list[Lag]) -> Regression | None:
    """The regression of all credible recordings; None with fewer than three."""
    overlaps = [(overlap(regressors[k], power, USUAL_LAG_S, lags[k]), lags[k].seconds) for k in _chosen(lags)]
    parts = [common.shifted(lag) for common, lag in overlaps if common is not None]
    if len(parts) < _MIN_RECORDINGS:
        return None
    X, y = _concatenated(parts)
    weights = ridge_regression(X, y, 1e-6)
    return Regression(weights, float((y - X @ weights).std()))


def _chosen(lags: list[Lag]) -> list[int]:
    """Indices of credible recordings, thinned out evenly."""
    credible = [k for k, lag in enumerate(lags) if lag.credible]
    return credible[:: max(1, len(credible) // _MAX_RECORDINGS)]


def _pooled(pairs: list[tuple[Overlap, float]], shift: float) -> float:
    return unexplained(*_concatenated([common.shifted(lag + shift) for common, lag in pairs]))


def _concatenated(parts: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Regressors and power of several recordings; the brakes' columns only if all recordings have them."""
    fewest = min(X.shape[1] for X, _ in parts)
    return np.concatenate([X[:, :fewest] for X, _ in parts]), np.concatenate([y for _, y in parts])


def _minimum(cost: np.ndarray) -> float:
    """Minimum of the cost over the candidates: the vertex of the parabola through the best one and its neighbours."""
    best = int(cost.argmin())
    if best in (0, len(_CANDIDATES_S) - 1):
        return _CANDIDATES_S[best]
    around = slice(best - 1, best + 2)
    a, b, _ = np.polyfit(_CANDIDATES_S[around], cost[around], 2)
    return min(max(float(-b / (2 * a)), _CANDIDATES_S[best - 1]), _CANDIDATES_S[best + 1])
