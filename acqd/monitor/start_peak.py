"""The largest deviation while a recording starts: what acts once per recording, such as the release of the brakes.

The charts of blocks see such a peak in one block of many, and their sums return to zero before the next one. Peaks are
therefore compared with peaks at the start of the recordings that the bundle remembers, one value per recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from acqd.arrays import Floats
from acqd.monitor.bound import bound
from acqd.monitor.thresholds import MONITOR

_LEAST_W = 1e-6
_LEAST_SPREAD = 0.05


@dataclass(frozen=True, slots=True)
class StartPeaks:
    """Of an unchanged robot."""

    centre: float
    """Mean of the logarithms of the peaks: upper 95 % confidence limit."""
    spread: float
    """Standard deviation: upper 90 % confidence limit."""
    bound: float
    """Of the CUSUM chart."""

    @classmethod
    def of(cls, peaks: list[float], between: float) -> StartPeaks | None:
        """From the peaks of recordings, in the order of time; None when they are too few.

        `between`: time between false alarms, in units of the time that all these recordings took. Mean and standard
        deviation of a dozen values are uncertain: with the estimates themselves, one chart in three would raise false
        alarms again and again. Their upper limits are those of normal values (mean; chi-square).
        """
        if len(peaks) < MONITOR.cusum_fewest_blocks:
            return None
        values, count = np.array(peaks), len(peaks)
        mean, deviation = float(values.mean()), max(float(values.std(ddof=1)), _LEAST_SPREAD)
        z = np.array([_standardised(value, mean, deviation) for value in peaks])
        between_starts = max(between * count, 2.0)
        normal = float(np.log(between_starts)) / (2 * MONITOR.cusum_slack)  # Lundberg's exponent is 2 k
        freedom = count - 1
        least = 2 * float(gammaincinv(freedom / 2, 0.1))  # 10 % quantile of chi-square
        return cls(
            mean + 1.645 * deviation / np.sqrt(count),
            deviation * np.sqrt(freedom / least),
            max(bound(z, between_starts), normal),
        )

    def charted(self, peak: float) -> float:
        """Increment of the chart."""
        return _standardised(peak, self.centre, self.spread)


def start_peak(errors: Floats, predicted: Floats, step_s: float) -> float | None:
    """Logarithm of the largest mean of a residual [T] W over 0.2 s, within the first block; None without a start.

    A start is a block that begins at rest and ends in motion, by the predicted power [T] W: a piece that was cut out of
    a motion has none.
    """
    rows = round(MONITOR.cusum_block_s / step_s)
    rest = round(MONITOR.cusum_rest_s / step_s)
    if len(errors) < rows or rest < 2:
        return None
    if predicted[:rest].std() > MONITOR.cusum_moving_W or predicted[:rows].std() <= MONITOR.cusum_moving_W:
        return None
    width = max(1, round(MONITOR.cusum_peak_s / step_s))
    means = np.convolve(errors[:rows], np.full(width, 1 / width), mode="valid")
    return float(np.log(max(float(np.abs(means).max()), _LEAST_W)))


def _standardised(peak: float, centre: float, spread: float) -> float:
    return float(np.clip((peak - centre) / spread, -MONITOR.cusum_clip, MONITOR.cusum_clip))
