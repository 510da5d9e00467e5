"""All recordings of one controller share one clock: their lags lie on a line of offset and drift.

The line averages what single recordings cannot know, and shows those that are wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.align import Lag
from acqd.numerics import theil_sen_slope

_OUTLIER_S = 0.03
"""A recording that lies so far off the line is wrong, or the clock was set."""
_LEAST = 4  # recordings that make a line


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
    """A robust line (Theil and Sen) through credible lags at controller times; None when they make none."""
    chosen = [k for k, lag in enumerate(lags) if lag.credible]
    if len(chosen) < _LEAST:
        return None
    t = times_s[chosen]
    values = np.array([lags[k].seconds for k in chosen])
    reference = float(np.median(t))
    slope = 0.0
    if np.ptp(t) > 600:  # over less, drift is lost in the scatter
        slope = theil_sen_slope(t, values, least_apart=float(np.ptp(t)) / 10)
    rest = values - slope * (t - reference)
    near = np.abs(rest - np.median(rest)) <= _OUTLIER_S
    if near.mean() < 0.6:
        return None  # set in between, or two clocks
    if np.ptp(t[near]) > 600:
        slope, offset = np.polyfit(t[near] - reference, values[near], 1)
    else:
        offset = float(values[near].mean())
    scatter = float((values[near] - offset - slope * (t[near] - reference)).std())
    return ClockLine(reference, float(offset), float(slope) * 1e6, scatter)


def deviates(line: ClockLine, time_s: float, lag: Lag) -> bool:
    """Whether a recording's own lag contradicts the line."""
    return abs(lag.seconds - float(line.at(time_s))) > max(_OUTLIER_S, 5 * line.scatter_s)
