"""The supply's first-order lag: mains power follows the robot's power later, which would look like a clock offset.

Lag and offset differ in how they smooth fast changes only. One regression of many recordings together tells them
apart. A pure delay of the supply cannot be told from a clock offset by any log: it is part of the lags. Nor can a
smoothing without delay, of currents from which power was computed or of the poses, be told from a supply's lag: below
BAND_HZ it weakens fast changes as a supply does whose lag is the standard deviation of its window, and the two differ
in their phase by the third power of frequency times lag only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from acqd.arrays import Floats
from acqd.dataset.align import Lag, Overlap, overlap
from acqd.dataset.common_fit import CommonFit, fit_common
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import Regressors
from acqd.dataset.slow_meter import SlowMeter, slow_meter
from acqd.numerics import NORMAL_95, biweight_loss

USUAL_LAG_S = 0.015
"""Lag of a usual supply: its bulk capacitor delays by most of a mains period. Assumed for one or two recordings."""
LONGEST_S = 0.06
"""A supply has no longer lag."""
_CANDIDATES_S = np.linspace(0.0, 0.075, 7)  # the outer ones keep the spline's end conditions away from LONGEST_S
_MODEL_ERROR_S = 0.004  # of the supply's lag: the regression is not the robot (tools/studies/alignment)
UNKNOWN_ERROR_S = 0.01
"""Standard error of USUAL_LAG_S, where nothing tells the supply."""
_FEW_RECORDINGS = 6
"""Fewer leave the supply's lag as uncertain as a usual one: the regression errs by another amount on each motion. With
three real ones of a UR10e the lag is 20 ms too long."""
_COARSE_ERROR_S = 0.02  # of USUAL_LAG_S, where only smoothed motion, or power, tells the lags
_MAX_RECORDINGS = 16
_MIN_RECORDINGS = 3
_FIRST_STEPS, _STEPS = 8, 3
_LATER = 0.8  # of a longer supply lag reappears in the lags
_END_S, _STEEP = 0.008, 4.0
"""A posterior mean so near to the longest lag, with -2 log likelihoods that still fall by so much towards that lag. A
mean of the meter must be worse than a long lag by as much to be ruled out."""


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
    average_s: float = 0.0
    """Time over which the meter averages where that is longer than the time between its rows."""
    meter: str = ""
    """What a user should know of a meter that smooths more than any supply."""


def supply_lag(
    regressors: list[Regressors], power: PowerStream, lags: list[Lag], progress: Callable[[float], None]
) -> SupplyLag:
    """The supply's lag from the recordings with a credible lag, whose lags were refined for the usual supply.

    The prior is uniform from 0 to 60 ms. Up to 16 recordings are used, thinned out evenly.
    """
    pairs = _overlaps(regressors, power, lags)
    chosen, overlaps = [k for k, _ in pairs], [single for _, single in pairs]
    if len(pairs) < _MIN_RECORDINGS:
        return SupplyLag(USUAL_LAG_S, UNKNOWN_ERROR_S, 0.0, UNKNOWN_ERROR_S, chosen, None)
    fits = _fits(overlaps, np.array([lags[k].seconds for k in chosen]), progress)
    scale_W = min(fit.scale_W for fit in fits)
    inflation = float(np.median([fit.inflation for fit in fits]))
    mean, error, at_end = _posterior(np.array([biweight_loss(fit.residual, scale_W) / inflation for fit in fits]))
    if power.coarse or any(
        regressors[k].coarse for k in chosen
    ):  # what the smoothing hides looks like a longer supply lag
        mean, error, at_end = USUAL_LAG_S, _COARSE_ERROR_S, False
    misfit = _MODEL_ERROR_S if len(chosen) >= _FEW_RECORDINGS else UNKNOWN_ERROR_S
    error = float(np.hypot(error, misfit))
    middles = np.array([float(np.median(fit.lags_s)) for fit in fits])
    at, usual, low, high = np.interp([mean, USUAL_LAG_S, mean - error, mean + error], _CANDIDATES_S, middles)
    nearest = fits[int(np.abs(_CANDIDATES_S - mean).argmin())]
    if at_end:
        meter = slow_meter([(regressors[k], lags[k]) for k in chosen], power, nearest, USUAL_LAG_S)
        if meter.average_s or meter.constant_s > _CANDIDATES_S[-1]:  # else a supply can be so slow
            return _behind_slow_meter(meter, chosen, float(usual))
    final = fit_common([o.behind_supply(mean) for o in overlaps], nearest.lags_s, nearest.weights, _STEPS)
    if not at_end and mean - NORMAL_95 * error > USUAL_LAG_S:  # a mean over some 0.1 s smooths as much
        meter = slow_meter([(regressors[k], lags[k]) for k in chosen], power, final, USUAL_LAG_S, filters=False)
        scale_W = min(final.scale_W, meter.fit.scale_W)
        behind_mean, behind_supply = (biweight_loss(fit.residual, scale_W) for fit in (meter.fit, final))
        if (behind_mean - behind_supply) / inflation < _STEEP:  # better, or nobody can tell
            return _behind_slow_meter(meter, chosen, float(usual))
    return SupplyLag(mean, error, float(at - usual), abs(float(high - low)) / 2, chosen, final)


def _behind_slow_meter(meter: SlowMeter, chosen: list[int], usual_s: float) -> SupplyLag:
    """What the recordings `chosen` say of supply and meter together; `usual_s`: their median lag without the meter."""
    shift_s = float(np.median(meter.fit.lags_s)) - usual_s
    error_s = meter.stamp_error_s / NORMAL_95
    return SupplyLag(
        meter.constant_s, UNKNOWN_ERROR_S if meter.average_s else error_s, shift_s, error_s, chosen, meter.fit,
        meter.average_s, meter.sentence(),
    )  # fmt: skip


def _overlaps(regressors: list[Regressors], power: PowerStream, lags: list[Lag]) -> list[tuple[int, Overlap]]:
    """Credible recordings with power, thinned out evenly, and their indices."""
    credible = [k for k, lag in enumerate(lags) if lag.credible]
    fine = [k for k in credible if not regressors[k].coarse]
    credible = fine if len(fine) >= _MIN_RECORDINGS else credible
    thinned = credible[:: max(1, -(-len(credible) // _MAX_RECORDINGS))]
    found = [(k, overlap(regressors[k], power, 0.0, lags[k])) for k in thinned]
    return [(k, single) for k, single in found if single is not None]


def _fits(overlaps: list[Overlap], lags_s: Floats, progress: Callable[[float], None]) -> list[CommonFit]:
    """One fit for each candidate, each from the result of the one before; `lags_s` belong to the usual supply."""
    fits: list[CommonFit] = []
    begin, weights = lags_s - USUAL_LAG_S, None
    for number, candidate in enumerate(_CANDIDATES_S):
        delayed = [single.behind_supply(float(candidate)) for single in overlaps]
        fits.append(fit_common(delayed, begin, weights, _STEPS if fits else _FIRST_STEPS))
        begin, weights = fits[-1].lags_s + _LATER * (_CANDIDATES_S[1] - _CANDIDATES_S[0]), fits[-1].weights
        progress((number + 1) / len(_CANDIDATES_S))
    return fits


def _posterior(loss: Floats) -> tuple[float, float, bool]:
    """Mean and standard deviation of the supply's lag for -2 log likelihoods at the candidates.

    And whether the likelihood still rises steeply at the longest lag. (At 0 this is usual: many supplies have no lag.)
    """
    grid = np.linspace(0.0, LONGEST_S, 121)
    values = CubicSpline(_CANDIDATES_S, loss)(grid)
    weight = np.exp(-(values - values.min()) / 2)
    weight /= weight.sum()
    mean = float(weight @ grid)
    rising = float(values[np.abs(grid - 2 * LONGEST_S / 3).argmin()] - values[-1]) > _STEEP
    at_end = mean > LONGEST_S - _END_S and rising
    return mean, float(np.sqrt(weight @ (grid - mean) ** 2)), at_end
