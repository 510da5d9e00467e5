"""What lies below the second harmonic, line by line, and between 2 kHz and 9 kHz, in bands.

Bands of 200 Hz are those of IEC 61000-4-7:2002+A1:2008, annex B, which IEC 61000-4-30:2015, annex C.2 refers to. The
annex measures 100 ms with a high pass in front, so that the fundamental does not leak into the bands; here the interval
of 10 or 12 cycles is resampled with its own f, holds whole cycles and needs no high pass. Its lines are half as far
apart, and as much of a band.
"""

from __future__ import annotations

import math

import numpy as np

from acqd.arrays import Floats
from acqd.metering.quality.resample import STOPBAND, WIDE, resampled
from acqd.metering.quality.response import IDEAL, Responses, without
from acqd.metering.quality.spectrum import Lines, smooth_points

HIGHEST_LINE_Hz = 100.0
LINES = 21
"""Lines of 5 Hz from 0 to HIGHEST_LINE_Hz; at an f off its nominal value, 5 Hz times f over that."""
LOWEST_Hz, HIGHEST_Hz = 2_000.0, 9_000.0
"""Of all bands."""
NARROW_Hz, BROAD_Hz = 200.0, 1_000.0
"""Widths of bands."""


def low_lines(lines: Lines) -> Floats:
    """RMS values of lines 0 .. 20 [channels, LINES] of an interval; line 0 is the magnitude of DC."""
    return np.abs(lines[:, :LINES])


def bands(
    x: Floats, start: float, length: float, cycles: int, f: float, responses: Responses = IDEAL
) -> tuple[Floats, Floats]:
    """RMS values [channels, 35] of bands of 200 Hz and [channels, 7] of 1 kHz from 2 to 9 kHz, squares of lines added.

    Of the interval [start, start + length) samples of `x` [channels, samples] with mains of `f` [Hz]. A band holds the
    lines above its lower edge, up to its upper one. NaN where the sampling rate does not reach, above 0.4 of it.
    """
    per_cycle = length / cycles
    rate = per_cycle * f
    points = cycles * smooth_points(math.ceil((STOPBAND + WIDE.passband) * per_cycle) + 2)
    even = resampled(x, start, length / points, points)
    lines = without(responses, np.fft.rfft(even, axis=1) * (np.sqrt(2) / points), f / cycles)
    squares = lines.real * lines.real + lines.imag * lines.imag
    at: Floats = np.arange(squares.shape[1], dtype=np.float64) * (f / cycles)
    known = WIDE.passband * rate
    return _grouped(squares, at, NARROW_Hz, known), _grouped(squares, at, BROAD_Hz, known)


def _grouped(squares: Floats, at: Floats, width: float, known: float) -> Floats:
    """Roots of the sums of `squares` [channels, lines] `at` frequencies [Hz]; NaN for bands that end above `known`."""
    upper = np.arange(LOWEST_Hz + width, HIGHEST_Hz + width / 2, width)
    # a line at an edge belongs below it, also where f is a little above its nominal value
    edges = np.searchsorted(at, np.append(LOWEST_Hz, upper) + at[1] / 4, side="right")
    sums = np.concatenate((np.zeros((len(squares), 1)), np.cumsum(squares, axis=1)), axis=1)[:, edges.clip(0, len(at))]
    result = np.sqrt(np.maximum(np.diff(sums, axis=1), 0.0))
    result[:, upper > known * (1 + 1e-9)] = np.nan
    return result
