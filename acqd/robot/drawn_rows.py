"""Rows that were computed between the poses of a slower recorder, by straight lines or splines.

Between two poses, such a curve is a polynomial: its fourth differences vanish there but for rounding, and beside the
poses they do not. Their size then follows the place between two poses, which is a period of some rows, not always a
whole number of them. Of recorded rows it follows the motion. Periods are looked for in the spectrum of the size, by the
sum of some harmonics (Noll 1969), and judged by the variance between the places (ADR 101).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.robot.resolution import steps_of

_ORDER = 4
_ROUNDED = 2 ** (_ORDER - 1)
"""Steps of written angles that rounding alone moves a fourth difference by, at most."""
_LONGEST_S = 0.25
"""From one pose to the next, at most: motion repeats itself more slowly."""
_PLACES = 1.5
"""Per row of a period: poses that lie between two rows are not all at the same place of a row."""
_MOST_ROWS, _LEAST_PERIODS = 20_000, 20
_EXPLAINED = 0.3
"""Share of the variance of the size of the differences (its logarithm) that the place between two poses explains. In
real logs of three robots no period explains more than 0.2."""
_NEARLY = 0.6
"""Of the best period: its multiples explain as much, and more where it is no whole number of rows."""
_LEAST_S = 0.05
"""Poses at a shorter distance hold what power rows of 40 ms show."""
_UNEVEN = 0.05
"""Steps of the time, over the usual one, that differ more are not of one rate."""
_HARMONICS, _FINER, _CANDIDATES, _REFINED = 4, 4, 16, 17
"""Of the spectrum: harmonics that are added, points per resolved frequency, highest points that are judged, and periods
between two points that are judged for each."""


def drawn_every(time: Floats, q: Floats) -> float:
    """Time [s, to 1 ms] from one recorded pose to the next, of angles [T, axes] at rising times [T] s.

    0 if all rows were recorded, or so many that nothing is lost.
    """
    time, q = time[:_MOST_ROWS], q[:_MOST_ROWS]
    step = np.diff(time)
    even = np.abs(step - np.median(step)) < _UNEVEN * np.median(step) if len(step) else np.zeros(0, bool)
    if len(step) <= _ORDER or not even.any():
        return 0.0
    usual_s = float(step[even].mean())
    size = np.linalg.norm(np.diff(q, n=_ORDER, axis=0), axis=1)
    speed = np.linalg.norm(q[_ORDER:] - q[:-_ORDER], axis=1)
    rows = np.rint((time[_ORDER:] - time[0]) / usual_s).astype(np.int64)
    used = np.lib.stride_tricks.sliding_window_view(even, _ORDER).all(axis=1) & (speed > np.median(speed))
    used &= rows < _MOST_ROWS
    longest = min(_LONGEST_S / usual_s, np.count_nonzero(used) / _LEAST_PERIODS)
    if longest <= _ORDER:
        return 0.0
    least = max(_ROUNDED * float(np.linalg.norm(steps_of(q))), 1e-3 * float(np.median(size)), 1e-15)
    logs, rows = np.log(np.maximum(size[used], least)), rows[used]
    periods = _candidates(rows, logs, longest)
    shares = np.array([_explained(logs, rows, period) for period in periods])
    if shares.max() < _EXPLAINED:
        return 0.0
    nearly = periods[shares >= _NEARLY * shares.max()]
    alike = np.abs(periods / nearly.min() - 1) < _UNEVEN
    every_s = round(usual_s * float(periods[alike][shares[alike].argmax()]), 3)
    return every_s if every_s > _LEAST_S else 0.0


def _candidates(rows: NDArray[np.int64], values: Floats, longest: float) -> Floats:
    """Periods in rows, from that of a fourth difference to `longest`, by the harmonic sum of values [T] at rows [T]."""
    series = np.zeros(int(rows.max()) + 1)
    series[rows] = values - values.mean()
    count = _FINER * len(series)
    power = np.abs(np.fft.rfft(series, count)) ** 2
    points = np.arange(int(np.ceil(count / longest)), count // _ORDER + 1)
    sums = np.zeros(len(points))
    for harmonic in range(1, _HARMONICS + 1):
        known = points * harmonic < len(power)
        sums[known] += power[points[known] * harmonic]
    best = points[np.argsort(-sums)[:_CANDIDATES]]
    between = np.linspace(-0.5, 0.5, _REFINED)
    return np.clip(np.ravel(count / (best[:, None] + between)), _ORDER, longest)


def _explained(values: Floats, rows: NDArray[np.int64], period: float) -> float:
    """Share of the variance of values [T] that the place in a period explains, less what it explains by chance."""
    place = (rows / period % 1 * int(_PLACES * period)).astype(np.int64)
    counts = np.bincount(place)
    means = np.bincount(place, values) / np.maximum(counts, 1)
    freedom = max(len(values) - int(np.count_nonzero(counts)), 1)
    within = float(((values - means[place]) ** 2).sum()) / freedom
    variance = float(values.var(ddof=1))
    return 1 - within / variance if variance > 1e-12 else 0.0
