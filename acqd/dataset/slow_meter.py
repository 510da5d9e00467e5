"""Meters that smooth: a mean over more than the time between two rows, or a first-order filter.

Where in the time of a mean its stamp lies, nothing in the rows says: at its begin, its middle or its end. A filter of
first order only looks back, as a supply does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.dataset.align import Lag, Overlap, overlap
from acqd.dataset.common_fit import CommonFit, fit_common
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import Regressors
from acqd.numerics import biweight_loss

_SHORTEST_S, _LONGEST_S, _MORE = 0.1, 2.4, 1.25
"""Times of smoothing that are tried, and the ratio of one to the next."""
_MEAN_OVER_CONSTANT = float(np.sqrt(12))
"""Time of a mean over the time constant of a filter that smooths slow changes as much."""
_STEPS = 6
_WORSE = 3
"""Worse fits in turn that end a search."""


@dataclass(frozen=True, slots=True)
class SlowMeter:
    """How a meter smooths, and the regression that belongs to it."""

    average_s: float
    """Time of the mean; 0 behind a filter."""
    constant_s: float
    """Time constant of the supply, and of a filter of the meter."""
    fit: CommonFit

    @property
    def stamp_error_s(self) -> float:
        """By how much all stamps may be off: a mean may be stamped at its begin or end, a filter is only assumed.

        The time of smoothing is known to the distance of two that were tried.
        """
        return _MORE * (self.average_s or self.constant_s) / 2

    def sentence(self) -> str:
        """What a user should know, without the lags' uncertainty."""
        smoothed = (
            f"were a mean over {self.average_s:.2g} s"
            if self.average_s
            else f"were smoothed with a time constant of {self.constant_s:.2g} s"
        )
        return (
            f"the power is as if it {smoothed} (or the recorder's poses came late): fast changes are lost, and nothing "
            "says where in that time its stamps lie; use a faster meter, or give the lag if it is known (--lag)"
        )


def slow_meter(
    recordings: list[tuple[Regressors, Lag]], power: PowerStream, before: CommonFit, supply_lag_s: float,
    *, filters: bool = True,
) -> SlowMeter:  # fmt: skip
    """The smoothing that explains the power best, behind a supply of `supply_lag_s`; without `filters`, a mean.

    `before` is the fit to the recordings without smoothing; at their lags, there is power.
    """
    tried = [
        each
        for mean in ((True, False) if filters else (True,))
        for each in _tried(recordings, power, before, supply_lag_s, mean=mean)
    ]
    scale_W = min(each.fit.scale_W for each in tried)
    return tried[int(np.argmin([biweight_loss(each.fit.residual, scale_W) for each in tried]))]


def _tried(
    recordings: list[tuple[Regressors, Lag]], power: PowerStream, before: CommonFit, supply_lag_s: float, *, mean: bool
) -> list[SlowMeter]:
    """Fits with longer and longer means or filters, until they become worse."""
    tried: list[SlowMeter] = []
    losses: list[float] = []
    last, at_s = before, _SHORTEST_S
    while at_s <= _LONGEST_S and int(np.argmin(losses or [0.0])) >= len(losses) - _WORSE:
        average_s, constant_s = (at_s, supply_lag_s) if mean else (0.0, at_s / _MEAN_OVER_CONSTANT)
        last = _fitted(recordings, power, last, (constant_s, average_s))
        tried.append(SlowMeter(average_s, constant_s, last))
        losses.append(biweight_loss(last.residual, before.scale_W))
        at_s *= _MORE
    return tried


def _fitted(
    recordings: list[tuple[Regressors, Lag]], power: PowerStream, last: CommonFit, smoothing: tuple[float, float]
) -> CommonFit:
    constant_s, average_s = smoothing
    parts: list[Overlap] = []
    for single, lag in recordings:
        part = overlap(single, power, constant_s, lag, average_s)
        assert part is not None
        parts.append(part)
    return fit_common(parts, last.lags_s, last.weights, _STEPS)
