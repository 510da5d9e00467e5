"""Positions of few digits, from the log's speeds of more digits: integrated, and held to the positions.

A milling machine writes its place to 1 mm and its speed to 0.01 mm/s. Smoothing such places until their accelerations
are right would hide the motion; the speeds hold it. Speeds may be late, or filtered, and off by a factor: the places
are regressed on the integral and on the speed, whose weights are the factor and minus the delay. What is left is the
error of the written places, and a slow drift of the integral, which a local quadratic follows (ADR 99).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from acqd.arrays import Floats
from acqd.robot.resolution import Smoothing, resolution, smoothed

_HELD_S, _HELD_ROWS = 4.0, 40
"""Over which the places hold the integral: long beside the smoothing that it replaces, short beside its drift."""
_FACTORS = (0.7, 1.4)
"""Speed over slope: filters change it by less, other units by more."""
_STRAY = 3.0
"""Steps of the written places: farther from the integral, a place is no rounded one, and stays as it is."""


def from_speeds(time: Floats, q: Floats, qd: Floats, smoothing: Smoothing) -> tuple[Floats, NDArray[np.bool_]]:
    """Positions [T, axes] at rising times [T] s, by speeds [T, axes] where these tell more, and [axes] where they do.

    That is where the smoothing that the positions need would hide fast motion, or has too few rows, and the speeds are
    those of the positions, with more digits.
    """
    fails = smoothing.fails(float(np.median(np.diff(time))))
    axes = np.isfinite(qd).all(axis=0) & fails & (smoothing.time_step_s == 0.0)
    places = q.copy()
    for axis in np.flatnonzero(axes):
        found = _place(time, q[:, axis], qd[:, axis], float(smoothing.q_step[axis]), float(smoothing.windows_s[axis]))
        axes[axis] = found is not None
        places[:, axis] = q[:, axis] if found is None else found
    return places, axes


def _place(time: Floats, q: Floats, qd: Floats, q_step: float, window_s: float) -> Floats | None:
    """[T] positions of one axis; None where its speeds do not tell them better."""
    if resolution(qd) * window_s > q_step:  # over its window, a position tells the speed as finely
        return None
    moved = np.asarray(cumulative_trapezoid(qd, time, initial=0.0))
    held_s = max(_HELD_S, _HELD_ROWS * float(np.median(np.diff(time))))
    known, place = np.ones(len(q), bool), q
    for _ in range(2):  # the second time without places that are far from the first
        fast = np.column_stack([moved, qd, q])[known]
        fast = fast - smoothed(time[known], fast, np.full(3, held_s))
        (factor, minus_delay), *_ = np.linalg.lstsq(fast[:, :2], fast[:, 2], rcond=None)
        shape = factor * moved + minus_delay * qd
        slow = smoothed(time[known], (q - shape)[known, None], np.array([held_s]))[:, 0]
        place = shape + np.interp(time, time[known], slow)
        known = np.abs(q - place) < _STRAY * q_step
        if not _FACTORS[0] < factor < _FACTORS[1] or not known.any():
            return None
    return np.where(known, place, q)
