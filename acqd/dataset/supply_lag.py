"""The supply's first-order lag: mains power follows the robot's power later, which would look like a clock offset.

Lag and offset differ in how they smooth fast changes only. One regression of many recordings together tells them
apart. A pure delay of the supply cannot be told from a clock offset by any log: it is part of the lags.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from acqd.arrays import Floats
from acqd.dataset.align import Lag, Overlap, overlap
from acqd.dataset.common_fit import CommonFit, biweight_loss, fit_common
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import Regressors

USUAL_LAG_S = 0.015
"""Lag of a usual supply: its bulk capacitor delays by most of a mains period. Assumed for one or two recordings."""
_LONGEST_S = 0.06
_CANDIDATES_S = np.linspace(0.0, 0.075, 7)  # the outer ones keep the spline's end conditions away from _LONGEST_S
_MODEL_ERROR_S = 0.005  # of the supply's lag: the regression is not the robot (tools/studies/alignment)
_UNKNOWN_ERROR_S = 0.012  # of USUAL_LAG_S
_MAX_RECORDINGS = 16
_MIN_RECORDINGS = 3
_FIRST_STEPS, _STEPS = 8, 3


@dataclass(frozen=True, slots=True)
class SupplyLag:
    """The supply's lag and the regression that belongs to it."""

    seconds: float
    error_s: float
    """Standard error."""
    shift_s: float
    """How much later a lag is than with the usual supply."""
    shared_error_s: float
    """Standard error of all lags together, which the supply's error causes."""
    chosen: list[int]
    """Indices of the recordings in `fit`."""
    fit: CommonFit | None
    """None with fewer than three recordings."""


def supply_lag(
    regressors: list[Regressors], power: PowerStream, lags: list[Lag], progress: Callable[[float], None]
) -> SupplyLag:
    """The supply's lag from the recordings with a credible lag, whose lags were refined for the usual supply.

    The prior is uniform from 0 to 60 ms. Up to 16 recordings are used, thinned out evenly.
    """
    pairs = _overlaps(regressors, power, lags, USUAL_LAG_S)
    if len(pairs) < _MIN_RECORDINGS:
        shared = _UNKNOWN_ERROR_S
        return SupplyLag(USUAL_LAG_S, _UNKNOWN_ERROR_S, 0.0, shared, [k for k, _ in pairs], None)
    chosen = [k for k, _ in pairs]
    fits = _fits(regressors, power, lags, chosen, progress)
    scale_W = min(fit.scale_W for fit in fits)
    inflation = float(np.median([fit.inflation for fit in fits]))
    loss = np.array([biweight_loss(fit.residual, scale_W) / inflation for fit in fits])
    mean, error = _posterior(loss)
    error = float(np.hypot(error, _MODEL_ERROR_S))
    middles = np.array([float(np.median(fit.lags_s)) for fit in fits])
    shift = float(np.interp(mean, _CANDIDATES_S, middles) - np.interp(USUAL_LAG_S, _CANDIDATES_S, middles))
    slope = np.interp(mean + error, _CANDIDATES_S, middles) - np.interp(mean - error, _CANDIDATES_S, middles)
    nearest = int(np.abs(_CANDIDATES_S - mean).argmin())
    found = [overlap(regressors[k], power, mean, lags[k]) for k in chosen]
    usable = [single for single in found if single is not None]
    final = fit_common(usable, fits[nearest].lags_s, fits[nearest].weights, _FIRST_STEPS)
    return SupplyLag(mean, error, shift, abs(float(slope)) / 2, chosen, final)


def _overlaps(
    regressors: list[Regressors], power: PowerStream, lags: list[Lag], supply_lag_s: float
) -> list[tuple[int, Overlap]]:
    """Credible recordings with power, thinned out evenly, and their indices."""
    credible = [k for k, lag in enumerate(lags) if lag.credible]
    thinned = credible[:: max(1, -(-len(credible) // _MAX_RECORDINGS))]
    found = [(k, overlap(regressors[k], power, supply_lag_s, lags[k])) for k in thinned]
    return [(k, single) for k, single in found if single is not None]


def _fits(
    regressors: list[Regressors],
    power: PowerStream,
    lags: list[Lag],
    chosen: list[int],
    progress: Callable[[float], None],
) -> list[CommonFit]:
    """One fit for each candidate, each from the result of the one before."""
    fits: list[CommonFit] = []
    begin = np.array([lags[k].seconds for k in chosen]) - USUAL_LAG_S
    weights: Floats | None = None
    for number, candidate in enumerate(_CANDIDATES_S):
        found = [overlap(regressors[k], power, float(candidate), lags[k]) for k in chosen]
        usable = [single for single in found if single is not None]
        fit = fit_common(usable, begin, weights, _STEPS if fits else _FIRST_STEPS)
        fits.append(fit)
        begin, weights = fit.lags_s + 0.7 * (_CANDIDATES_S[1] - _CANDIDATES_S[0]), fit.weights
        progress((number + 1) / len(_CANDIDATES_S))
    return fits


def _posterior(loss: Floats) -> tuple[float, float]:
    """Mean and standard deviation of the supply's lag for -2 log likelihoods at the candidates."""
    grid = np.linspace(0.0, _LONGEST_S, 121)
    values = CubicSpline(_CANDIDATES_S, loss)(grid)
    weight = np.exp(-(values - values.min()) / 2)
    weight /= weight.sum()
    mean = float(weight @ grid)
    return mean, float(np.sqrt(weight @ (grid - mean) ** 2))
