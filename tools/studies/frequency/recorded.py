"""Mean f of a recording between two instants: zero crossings after a band pass without a phase shift.

An independent method, with samples before and after: the band from 35 to 75 Hz, twice of second order (forwards and
backwards), rising and falling crossings of all phases.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acqd.arrays import Floats

_BAND = (35.0, 75.0)


def true_f(u: Floats, rate: float) -> Callable[[Floats, Floats], Floats]:
    """Of `u` [phases, samples]; positions in samples, sample k is the cell [k, k + 1)."""
    turns = [_turns(phase, rate) for phase in u]
    return lambda begin, end: np.asarray(
        np.mean([(of(end) - of(begin)) / ((end - begin) / rate) for of in turns], axis=0)
    )


def _turns(u: Floats, rate: float) -> Callable[[Floats], Floats]:
    """Cycles since the first crossing, at positions [samples]."""
    from scipy.interpolate import CubicSpline
    from scipy.signal import butter, sosfiltfilt

    filtered = sosfiltfilt(butter(2, _BAND, "band", fs=rate, output="sos"), u - u.mean())
    rising, falling = _crossings(filtered), _crossings(-filtered)
    one = CubicSpline(rising, np.arange(len(rising)))
    falling = falling[(falling > rising[0]) & (falling < rising[-1])]
    other = CubicSpline(falling, np.round(one(falling) - 0.5) + 0.5)
    return lambda at: np.asarray((one(at) + other(at)) / 2)


def _crossings(x: Floats) -> Floats:
    before = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    return np.asarray(before + 0.5 + x[before] / (x[before] - x[before + 1]))
