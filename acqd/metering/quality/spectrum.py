"""DFT over exactly 10 or 12 cycles, and the groups of IEC 61000-4-7:2002+A1:2008.

The interval is resampled to a power of two of points per cycle (`resample`), so that the rectangular window holds whole
cycles and no line leaks into another one. Lines are 5 Hz apart at 50 Hz (N = 10 lines per harmonic) and 60 Hz (N = 12).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.quality.decimate import decimated, droop, factor_of
from acqd.metering.quality.resample import PASSBAND, resampled

ORDERS = 50
"""Harmonics in a row (IEC 61000-4-30 class A)."""
Lines = NDArray[np.complex128]
"""[channels, lines] RMS phasors; line k is at k / (10 or 12) times f, line 0 is DC."""


def spectrum(x: Floats, start: float, length: float, cycles: int) -> Lines:
    """Lines of the interval [start, start + length) samples of `x` [channels, samples], up to the 51st harmonic.

    Phases refer to the start of the interval, angle 0 is a cosine.
    """
    factor = factor_of(length / cycles)
    points = cycles * _points_per_cycle(length / factor / cycles)
    slow = decimated(x, factor)
    even = resampled(slow, start / factor, length / factor / points, points)
    lines = np.fft.rfft(even, axis=1)[:, : (ORDERS + 1) * cycles + 1] / points
    lines[:, 1:] *= np.sqrt(2)
    return np.asarray(lines / droop(np.arange(lines.shape[1]) / length, factor))


def harmonic_subgroups(lines: Lines, cycles: int) -> Floats:
    """G_sg,n of harmonics n = 1 .. 50 [channels, 50]: the harmonic's line and its two neighbours, squares added.

    IEC 61000-4-7, section 5.5.1.
    """
    return _grouped(lines, np.arange(1, ORDERS + 1) * cycles, range(-1, 2))


def interharmonic_subgroups(lines: Lines, cycles: int) -> Floats:
    """G_isg,n centred subgroups between harmonics n and n + 1, n = 0 .. 49 [channels, 50]: all lines but the
    neighbours of harmonics. IEC 61000-4-7, annex A; used by IEC 61000-4-30, section 5.9.
    """
    return _grouped(lines, np.arange(ORDERS) * cycles, range(2, cycles - 1))


def interharmonic_groups(lines: Lines, cycles: int) -> Floats:
    """G_ig,n between harmonics n and n + 1, n = 0 .. 49 [channels, 50]: all lines between them, squares added.

    IEC 61000-4-7, section 5.6.
    """
    return _grouped(lines, np.arange(ORDERS) * cycles, range(1, cycles))


def signalling(lines: Lines, f_line: float, carrier: float) -> Floats:
    """Mains signalling voltage [channels] at `carrier` [Hz]: the four nearest lines, squares added; NaN beyond them.

    Lines are `f_line` Hz apart. IEC 61000-4-30, section 5.10.
    """
    below = int(carrier / f_line)
    if below < 2 or below + 2 >= lines.shape[1]:
        return np.full(len(lines), np.nan)
    return _grouped(lines, np.array([below]), range(-1, 3))[:, 0]


def known_orders(rate: float, f: float) -> int:
    """Harmonics that a stream of `rate` [1/s] tells, 0 .. 50."""
    return min(ORDERS, int((PASSBAND * rate / f) - 0.2))


def thds(subgroups: Floats) -> Floats:
    """Total harmonic distortion of subgroups 2 .. 50 in % of the first; NaN where there is no fundamental.

    THDS of IEC 61000-4-7, section 3.2. Harmonics that the sampling rate does not tell (NaN) are left out.
    """
    distortion = np.sqrt(np.nansum(np.square(subgroups[:, 1:]), axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(subgroups[:, 0] > 0, 100 * distortion / subgroups[:, 0], np.nan))


def _grouped(lines: Lines, centres: NDArray[np.int64], around: range) -> Floats:
    squares = np.square(np.abs(lines))
    return np.asarray(np.sqrt(sum(squares[:, centres + k] for k in around)))


def _points_per_cycle(samples: float) -> int:
    """Power of two not below `samples` per cycle, so that nothing folds; enough for the 51st harmonic."""
    return max(128, 1 << math.ceil(math.log2(samples)))
