"""Samples at other instants: interpolation by a Kaiser-windowed sinc.

A DFT over exactly 10 or 12 cycles needs a whole number of samples in them. The window is 32 samples long and damps
images by 90 dB; up to PASSBAND of the sampling rate amplitudes are kept within 1e-5 (Kaiser 1974; Oppenheim and
Schafer, Discrete-Time Signal Processing, section 7.5.3).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from acqd.arrays import Floats
from acqd.metering.kernel.compiled import as_rows, quality_library, rows_of

TAPS = 32
MARGIN = TAPS // 2 + 1
"""Samples needed before the first instant and after the last one."""
PASSBAND = 0.4
"""Share of the sampling rate; the transition band of the window begins here."""
_LANES = 8  # channels at most in C
_BETA = 8.96  # 90 dB: 0.1102 (A - 8.7)
_STEPS = 1024  # tabulated fractions of a sample; linear in between: 2e-6 of the amplitude


def resampled(x: Floats, start: float, step: float, count: int) -> Floats:
    """`x` [channels, samples] at `count` instants start + k * step, [channels, count].

    In cells: sample n is at n + 1/2. MARGIN samples must lie before and after the instants, else IndexError. In C where
    there is a compiler (`kernel/quality.c`); both ways agree to rounding.
    """
    first, last = (math.floor(start - 0.5 + step * k) for k in (0, count - 1))
    if first < TAPS // 2 - 1 or last + TAPS // 2 >= x.shape[1]:
        raise IndexError(f"instants {first} .. {last} need samples beyond the {x.shape[1]} that are there")
    library = quality_library()
    if library is None or len(x) > _LANES:
        return resampled_by_numpy(x, start, step, count)
    x = as_rows(x)
    result, scratch = np.empty((len(x), count)), np.empty((x.shape[1], _LANES))
    library.acqd_resample(
        *rows_of(x), start - 0.5, step, count, _rows().ctypes.data, _STEPS, scratch.ctypes.data, result.ctypes.data
    )
    return result


def resampled_by_numpy(x: Floats, start: float, step: float, count: int) -> Floats:
    """The same without C: the reference."""
    at = start - 0.5 + step * np.arange(count)
    whole = np.floor(at).astype(np.int64)
    weights = _weights(at - whole)
    first = whole - (TAPS // 2 - 1)
    result = np.zeros((len(x), count))
    for tap in range(TAPS):
        result += weights[tap] * np.take(x, first + tap, axis=1)
    return result


def _weights(fraction: Floats) -> Floats:
    """[TAPS, instants]."""
    position = fraction * _STEPS
    row = position.astype(np.int64)
    table, share = _table(), position - row
    return np.asarray(np.take(table, row, axis=1) * (1 - share) + np.take(table, row + 1, axis=1) * share)


@lru_cache(maxsize=1)
def _table() -> Floats:
    """[TAPS, fractions 0 .. 1]; the weights of each fraction sum to 1, so that DC is exact."""
    fractions = np.arange(_STEPS + 2) / _STEPS
    distance = np.arange(TAPS)[:, None] - (TAPS // 2 - 1) - fractions
    window = np.i0(_BETA * np.sqrt(np.maximum(0.0, 1 - (distance / (TAPS / 2)) ** 2))) / np.i0(_BETA)
    weights = np.sinc(distance) * window
    return np.asarray(weights / weights.sum(axis=0))


@lru_cache(maxsize=1)
def _rows() -> Floats:
    """[fractions, TAPS], as C reads the table."""
    return np.ascontiguousarray(_table().T)
