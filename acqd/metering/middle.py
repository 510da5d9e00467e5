"""f at the middle of the interval that the other quantities are from.

f is fitted over a longer stretch, which ends with the window: its middle is 10 ms before the interval's. The
slope over the last estimates bridges this: over three windows, so that it adds a tenth to the noise of f.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats

SPAN = 3
"""Known estimates between the two that the slope is taken from."""
_OLDEST = 6  # windows


class MiddleFrequency:
    """Remembers the last known estimates of a stream."""

    def __init__(self, window: float) -> None:
        """`window` [samples]."""
        self.oldest = _OLDEST * window
        """Samples; estimates that are older tell no slope."""
        self.f = np.empty(0)
        """The last known estimates [Hz], at most SPAN."""
        self.at = np.empty(0)
        """Their times [samples of the stream]."""

    def reset(self) -> None:
        """The next window has none before it."""
        self.f = self.at = np.empty(0)

    def shift(self, f: Floats, at: Floats, to: Floats) -> Floats:
        """`f` of consecutive windows [Hz], valid at the times `at`, extrapolated to the times `to` [samples]."""
        known = ~np.isnan(f)
        values, times = np.concatenate((self.f, f[known])), np.concatenate((self.at, at[known]))
        here = np.arange(len(self.f), len(values))
        before = np.maximum(here - SPAN, 0)
        for _ in range(SPAN - 1):  # nearer ones, where that is too old
            before = np.where(times[here] - times[before] > self.oldest, np.minimum(before + 1, here), before)
        span = times[here] - times[before]
        fresh = (span > 0) & (span <= self.oldest)
        slope = np.divide(values[here] - values[before], span, out=np.zeros(len(here)), where=fresh)
        self.f, self.at = values[-SPAN:], times[-SPAN:]
        result = f.copy()
        result[known] += slope * (to - at)[known]
        return result
