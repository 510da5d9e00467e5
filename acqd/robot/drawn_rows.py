"""Rows that were computed between the poses of a slower recorder, by straight lines or splines.

Between two poses, such a curve is a polynomial: its fourth differences vanish there but for rounding, and beside the
poses they do not. Their size then follows the place between two poses, which is a period of some rows. Of recorded rows
it follows the motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

_ORDER = 4
_LONGEST_S = 0.25
"""From one pose to the next, at most: motion repeats itself more slowly."""
_MOST_ROWS, _LEAST_PERIODS = 20_000, 20
_EXPLAINED = 0.3
"""Share of the variance of the size of the differences (its logarithm) that the place between two poses explains. In
real logs of three robots no period explains more than 0.1."""
_NEARLY = 0.9
"""Of the best period: its multiples explain as much."""
_LEAST_S = 0.05
"""Poses at a shorter distance hold what power rows of 40 ms show."""
_UNEVEN = 0.05
"""Steps of the time, over the usual one, that differ more are not of one rate."""


def drawn_every(time: Floats, q: Floats) -> float:
    """Time [s] from one recorded pose to the next, of angles [T, axes] at rising times [T] s.

    0 if all rows were recorded, or so many that nothing is lost.
    """
    time, q = time[:_MOST_ROWS], q[:_MOST_ROWS]
    step = np.diff(time)
    if len(step) <= _ORDER:
        return 0.0
    usual_s = float(np.median(step))
    even = np.abs(step - usual_s) < _UNEVEN * usual_s
    size = np.linalg.norm(np.diff(q, n=_ORDER, axis=0), axis=1)
    speed = np.linalg.norm(q[_ORDER:] - q[:-_ORDER], axis=1)
    used = np.lib.stride_tricks.sliding_window_view(even, _ORDER).all(axis=1) & (speed > np.median(speed))
    row = np.rint((time[_ORDER:] - time[0]) / usual_s).astype(np.int64)[used]
    if len(row) < _LEAST_PERIODS:
        return 0.0
    logs = np.log(size[used] + np.median(size) * 1e-3 + 1e-15)
    longest = min(round(_LONGEST_S / usual_s), len(row) // _LEAST_PERIODS)
    shares = [_explained(logs, row % rows) for rows in range(2, longest + 1)]
    if not shares or max(shares) < _EXPLAINED:
        return 0.0
    every_s = usual_s * (2 + next(k for k, share in enumerate(shares) if share >= _NEARLY * max(shares)))
    return every_s if every_s > _LEAST_S else 0.0


def _explained(values: Floats, place: NDArray[np.int64]) -> float:
    """Share of the variance of values [T] between the means of their places [T]."""
    counts = np.bincount(place)
    means = np.bincount(place, values) / np.maximum(counts, 1)
    return float(((means[place] - values.mean()) ** 2).mean() / max(values.var(), 1e-12))
