"""The mains side's first-order lag behind the robot, which would pass for clock offset if nobody asked for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from acqd.arrays import Floats
from acqd.dataset.align import Lag, Overlap, overlap, unexplained
from acqd.dataset.clock_line import fit_line
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Explanation
from acqd.numerics import ridge_regression

USUAL_LAG_S = 0.015
"""Of a usual supply: its bulk capacitor delays by most of a mains period."""
_SPREAD_S = 0.01
# Share of what is unexplained that must vanish before a supply one spread off the usual is believed; less than
# that is within what the regression itself gets wrong, and a wrong supply shifts every recording alike.
_WORTH = 0.05
_CANDIDATES_S = (0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05)
_PROBED = 24  # recordings
_LEAST_COMMON = 3


def supply_lag(explained: list[Explanation], power: PowerStream, lags: list[Lag]) -> tuple[float, float]:
    """The supply's lag [s], and what it shifts all lags by [s], which were refined for the usual one.

    One regression of all probed recordings together, at the lags of their common clock: alone, a recording has
    too few independent seconds for so many quantities, and fits the wrong supply nearly as well.
    """
    chosen = [k for k, lag in enumerate(lags) if lag.credible]
    chosen = chosen[:: max(1, len(chosen) // _PROBED)]
    middles = np.array([explained[k].start_s + len(explained[k].columns) * STEP_S / 2 for k in chosen])
    line = fit_line(middles, [lags[k] for k in chosen])
    placed = [float(line.at(t)) if line else lags[k].seconds for k, t in zip(chosen, middles, strict=True)]
    shifts = np.zeros(len(_CANDIDATES_S))
    left_over = np.zeros(len(_CANDIDATES_S))
    for number, candidate in enumerate(_CANDIDATES_S):
        found = [overlap(explained[k], power, candidate, lags[k]) for k in chosen]
        both = [(pair, lag) for pair, lag in zip(found, placed, strict=True) if pair is not None]
        if not both:
            return USUAL_LAG_S, 0.0
        expected = candidate - USUAL_LAG_S
        best = minimize_scalar(
            lambda shift, both=both: _pooled(both, shift),
            bounds=(expected - 0.02, expected + 0.02),
            method="bounded",
            options={"xatol": 5e-4},
        )
        shifts[number] = best.x
        left_over[number] = np.log(best.fun + 1e-9) + _WORTH * (expected / _SPREAD_S) ** 2
    lag = _lowest(left_over)
    return lag, float(np.interp(lag, _CANDIDATES_S, shifts))


@dataclass(frozen=True, slots=True)
class Regression:
    """What power the motion takes, by all credible recordings together."""

    weights: Floats
    """[k] W per quantity."""
    rest_W: float
    """RMS that it leaves in them."""

    def rest(self, X: Floats, y: Floats) -> float:
        """RMS (W) that it leaves in another recording's quantities and power, both centred."""
        kept = min(len(self.weights), X.shape[1])
        return float((y - X[:, :kept] @ self.weights[:kept]).std())


def common_regression(explained: list[Explanation], power: PowerStream, lags: list[Lag]) -> Regression | None:
    """None with fewer than three credible recordings."""
    chosen = [k for k, lag in enumerate(lags) if lag.credible]
    chosen = chosen[:: max(1, len(chosen) // _PROBED)]
    found = [(overlap(explained[k], power, USUAL_LAG_S, lags[k]), lags[k].seconds) for k in chosen]
    parts = [both.shifted(lag) for both, lag in found if both is not None]
    if len(parts) < _LEAST_COMMON:
        return None
    fewest = min(X.shape[1] for X, _ in parts)
    X, y = np.concatenate([X[:, :fewest] for X, _ in parts]), np.concatenate([y for _, y in parts])
    weights = ridge_regression(X, y, 1e-6)
    return Regression(weights, float((y - X @ weights).std()))


def _pooled(both: list[tuple[Overlap, float]], shift: float) -> float:
    fewest = min(pair.columns.shape[1] for pair, _ in both)  # not every log has its brake
    parts = [pair.shifted(lag + shift) for pair, lag in both]
    return unexplained(np.concatenate([X[:, :fewest] for X, _ in parts]), np.concatenate([y for _, y in parts]))


def _lowest(left_over: np.ndarray) -> float:
    """The candidate, or the vertex of the parabola through it and its neighbours."""
    best = int(left_over.argmin())
    if best in (0, len(_CANDIDATES_S) - 1):
        return _CANDIDATES_S[best]
    around = slice(best - 1, best + 2)
    a, b, _ = np.polyfit(_CANDIDATES_S[around], left_over[around], 2)
    return min(max(float(-b / (2 * a)), _CANDIDATES_S[best - 1]), _CANDIDATES_S[best + 1])
