"""Noise floor: the part of the measured power that no model of the motion can predict."""

from __future__ import annotations

import numpy as np

from acqd.models.segments import Segment
from acqd.numerics import mad_sigma, runs_of_true

STILL_RAD_S = 0.005
"""Speed of a joint (rad/s, or m/s) below which the joint rests."""
_SETTLING_ROWS = 10  # after a motion
_WINDOW_ROWS = 50
_MIN_WINDOWS = 5
MAE_PER_RMS = float(np.sqrt(2 / np.pi))
"""Mean absolute value of a normal distribution over its standard deviation."""


def noise_floor(segments: list[Segment], step_s: float) -> tuple[float, str]:
    """RMS of the noise in W, and where it was measured.

    At rest: the median standard deviation of the power in windows of 50 rows (two seconds) in which no joint moves.
    The median is robust against windows in which a brake or a tool switches. With fewer than five windows: the robust
    standard deviation of the second differences over sqrt(6), which holds for white noise on a smooth power.
    """
    deviations = []
    for segment in segments:
        speed = np.abs(segment.motion(step_s)[1]).max(axis=1)
        for first, last in runs_of_true(speed < STILL_RAD_S):
            rest = segment.P[first + _SETTLING_ROWS : last]
            starts = range(0, len(rest) - _WINDOW_ROWS + 1, _WINDOW_ROWS)
            deviations += [rest[start : start + _WINDOW_ROWS].std() for start in starts]
    if len(deviations) >= _MIN_WINDOWS:
        return float(np.median(deviations)), "at rest, within two seconds"
    second_differences = np.concatenate([np.diff(segment.P, 2) for segment in segments])
    return float(mad_sigma(second_differences, 0.0) / np.sqrt(6)), "between neighbouring rows"
