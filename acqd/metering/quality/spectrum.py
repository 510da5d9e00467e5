"""DFT over exactly 10 or 12 cycles, and the groups of IEC 61000-4-7:2002+A1:2008.

The interval is resampled to a whole number of points per cycle (`resample`), so that the rectangular window holds whole
cycles and no line leaks into another one. Lines are 5 Hz apart at 50 Hz (N = 10 lines per harmonic) and 60 Hz (N = 12).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.kernel.compiled import quality_library
from acqd.metering.quality.decimate import decimated, droop, factor_of
from acqd.metering.quality.resample import SHORT, STOPBAND, WIDE, resampled

ORDERS = 50
"""Harmonics in a row (IEC 61000-4-30 class A)."""
Lines = NDArray[np.complex128]
"""[channels, lines] RMS phasors; line k is at k / (10 or 12) times f, line 0 is DC."""


def spectrum(x: Floats, start: float, length: float, cycles: int) -> Lines:
    """Lines of the interval [start, start + length) samples of `x` [channels, samples], up to the 51st harmonic.

    Phases refer to the start of the interval, angle 0 is a cosine.
    """
    factor = factor_of(length / cycles)
    per_cycle = length / factor / cycles
    points = cycles * _points_per_cycle(float(math.ceil(per_cycle)))
    slow, how = decimated(x, factor), SHORT if SHORT.passband * per_cycle >= ORDERS + 1 else WIDE
    even = resampled(slow, start / factor, length / factor / points, points, how)
    lines = np.fft.rfft(even, axis=1)[:, : (ORDERS + 1) * cycles + 1] * _rms(cycles, points)
    return lines if factor == 1 else np.asarray(lines / droop(np.arange(lines.shape[1]) / length, factor))


def line_squares(lines: Lines, cycles: int) -> Floats:
    """Squares of the lines [channels, 51, cycles]: at order n, line k is that at n + k / cycles times f."""
    used = lines[:, : (ORDERS + 1) * cycles]
    squares = used.real * used.real + used.imag * used.imag
    return np.asarray(squares.reshape(len(lines), ORDERS + 1, cycles))


def harmonic_subgroups(squares: Floats) -> Floats:
    """G_sg,n of harmonics n = 1 .. 50 [channels, 50]: the harmonic's line and its two neighbours, squares added.

    IEC 61000-4-7, section 5.5.1.
    """
    return np.asarray(np.sqrt(squares[:, :-1, -1] + squares[:, 1:, 0] + squares[:, 1:, 1]))


def interharmonic_subgroups(squares: Floats) -> Floats:
    """G_isg,n centred subgroups between harmonics n and n + 1, n = 0 .. 49 [channels, 50]: all lines but the
    neighbours of harmonics. IEC 61000-4-7, annex A; used by IEC 61000-4-30, section 5.9.
    """
    return np.asarray(np.sqrt(squares[:, :-1, 2:-1].sum(axis=2)))


def interharmonic_groups(squares: Floats) -> Floats:
    """G_ig,n between harmonics n and n + 1, n = 0 .. 49 [channels, 50]: all lines between them, squares added.

    IEC 61000-4-7, section 5.6.
    """
    return np.asarray(np.sqrt(squares[:, :-1, 1:].sum(axis=2)))


def signalling(lines: Lines, f_line: float, carrier: float) -> Floats:
    """Mains signalling voltage [channels] at `carrier` [Hz]: the four nearest lines, squares added; NaN beyond them.

    Lines are `f_line` Hz apart. IEC 61000-4-30, section 5.10.
    """
    below = int(carrier / f_line)
    if below < 2 or below + 2 >= lines.shape[1]:
        return np.full(len(lines), np.nan)
    return np.asarray(np.sqrt(np.square(np.abs(lines[:, below - 1 : below + 3])).sum(axis=1)))


def known_orders(rate: float, f: float) -> int:
    """Harmonics that a stream of `rate` [1/s] tells, 0 .. 50."""
    return min(ORDERS, int((WIDE.passband * rate / f) - 0.2))


def thds(subgroups: Floats) -> Floats:
    """Total harmonic distortion of subgroups 2 .. 50 in % of the first; NaN where there is no fundamental.

    THDS of IEC 61000-4-7, section 3.2. Harmonics that the sampling rate does not tell (NaN) are left out.
    """
    squares = np.square(subgroups[:, 1:])
    squares[np.isnan(squares)] = 0.0
    distortion = np.sqrt(squares.sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(subgroups[:, 0] > 0, 100 * distortion / subgroups[:, 0], np.nan))


def groups(lines: Lines, cycles: int, known: int) -> tuple[Floats, Floats, Floats]:
    """Harmonic subgroups, interharmonic subgroups and THDS, NaN beyond `known` harmonics.

    In C where there is a compiler (`kernel/quality.c`).
    """
    library = quality_library()
    if library is None or not lines.flags.c_contiguous or lines.shape[1] != (ORDERS + 1) * cycles + 1:
        return groups_by_numpy(lines, cycles, known)
    out = np.empty((2, len(lines), ORDERS)), np.empty(len(lines))
    harmonics, between = out[0]
    library.acqd_groups(
        lines.ctypes.data, len(lines), cycles, known, harmonics.ctypes.data, between.ctypes.data, out[1].ctypes.data
    )
    return harmonics, between, out[1]


def groups_by_numpy(lines: Lines, cycles: int, known: int) -> tuple[Floats, Floats, Floats]:
    """The same without C: the reference."""
    squares = line_squares(lines, cycles)
    harmonics, between = harmonic_subgroups(squares), interharmonic_subgroups(squares)
    harmonics[:, known:] = between[:, known:] = np.nan
    return harmonics, between, thds(harmonics)


@lru_cache(maxsize=16)
def _rms(cycles: int, points: int) -> Floats:
    """RMS per number of a DFT, by line."""
    factors = np.full((ORDERS + 1) * cycles + 1, math.sqrt(2) / points)
    factors[0] = 1 / points
    return factors


@lru_cache(maxsize=64)
def _points_per_cycle(samples: float) -> int:
    """Points of a cycle of so many samples, a product of powers of 2, 3 and 5.

    Images lie below STOPBAND of the sampling rate; folded, they must end above the 51st harmonic.
    """
    return smooth_points(max(128, math.ceil(STOPBAND * samples + ORDERS + 2)))


def smooth_points(least: int) -> int:
    """The first number from `least` on that is a product of powers of 2, 3 and 5: fast for a DFT."""
    while not _smooth(least):
        least += 1
    return least


def _smooth(number: int) -> bool:
    for factor in (2, 3, 5):
        while number % factor == 0:
            number //= factor
    return number == 1
