"""The clock line of one controller: the lags of its recordings lie on a line of offset and drift.

The line averages the errors of single recordings, and it shows which recordings contradict the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.align import Lag
from acqd.numerics import theil_sen_slope

_OUTLIER_S = 0.03
"""A recording this far off the line has a wrong lag, or the clock was set."""
_MIN_RECORDINGS = 4
_MIN_INLIERS = 0.6  # share of the recordings
_DRIFT_SPAN_S = 600.0  # over a shorter time the drift is lost in the scatter


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Lag of a controller's clock over its own time."""

    reference_s: float
    """Controller time at which the offset holds."""
    offset_s: float
    drift_ppm: float
    scatter_s: float
    """Standard deviation of the recordings around the line."""

    def at(self, time_s: Floats | float) -> Floats | float:
        """Lag [s] at controller time."""
        return self.offset_s + self.drift_ppm * 1e-6 * (time_s - self.reference_s)


def fit_line(times_s: Floats, lags: list[Lag]) -> ClockLine | None:
    """The line through the credible lags at controller times; None when they are too few or on no common line.

    A Theil-Sen line finds the outliers; least squares through the other recordings then gives offset and drift.
    """
    chosen = [k for k, lag in enumerate(lags) if lag.credible]
    if len(chosen) < _MIN_RECORDINGS:
        return None
    t = times_s[chosen]
    values = np.array([lags[k].seconds for k in chosen])
    reference = float(np.median(t))
    slope = 0.0
    if np.ptp(t) > _DRIFT_SPAN_S:
        slope = theil_sen_slope(t, values, least_apart=float(np.ptp(t)) / 10)
    residual = values - slope * (t - reference)
    near = np.abs(residual - np.median(residual)) <= _OUTLIER_S
    if near.mean() < _MIN_INLIERS:
        return None  # the clock was set in between, or there are two clocks
    if np.ptp(t[near]) > _DRIFT_SPAN_S:
        slope, offset = np.polyfit(t[near] - reference, values[near], 1)
    else:
        offset = float(values[near].mean())
    scatter = float((values[near] - offset - slope * (t[near] - reference)).std())
    return ClockLine(reference, float(offset), float(slope) * 1e6, scatter)


def deviates(line: ClockLine, time_s: float, lag: Lag) -> bool:
    """Whether a recording's own lag contradicts the line."""
    return abs(lag.seconds - float(line.at(time_s))) > max(_OUTLIER_S, 5 * line.scatter_s)
