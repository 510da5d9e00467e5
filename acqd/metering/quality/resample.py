"""Samples at other instants: interpolation by a Kaiser-windowed sinc.

A DFT over exactly 10 or 12 cycles needs a whole number of samples in them. The window damps images by 90 dB or more
(Kaiser 1974; Oppenheim and Schafer, Discrete-Time Signal Processing, section 7.5.3). A stream with many samples per
cycle is interpolated by half as many samples: what it must keep lies far below what must go.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acqd.arrays import Floats
from acqd.metering.kernel.compiled import as_rows, quality_library, rows_of

STOPBAND = 0.6
"""Share of the sampling rate from which on images are damped."""
_LANES = 8  # channels at most in C


@dataclass(frozen=True)
class Interpolation:
    """Weights of the samples around an instant."""

    taps: int
    """Samples; 16 or 32."""
    passband: float
    """Share of the sampling rate up to which amplitudes are kept within 3e-5; the transition band begins here."""
    beta: float
    """Of Kaiser's window: 0.1102 (A - 8.7) damps by A [dB]."""
    steps: int
    """Tabulated fractions of a sample; linear in between: 2e-6 of the amplitude."""

    @cached_property
    def rows(self) -> Floats:
        """[fractions 0 .. 1, taps]; the weights of each fraction sum to 1, so that DC is exact."""
        fractions = np.arange(self.steps + 2)[:, None] / self.steps
        distance = np.arange(self.taps) - (self.taps // 2 - 1) - fractions
        window = np.i0(self.beta * np.sqrt(np.maximum(0.0, 1 - (distance / (self.taps / 2)) ** 2)))
        weights = np.sinc((self.passband + STOPBAND) * distance) * window
        return np.ascontiguousarray(weights / weights.sum(axis=1, keepdims=True))


WIDE = Interpolation(taps=32, passband=0.4, beta=8.96, steps=1024)
SHORT = Interpolation(taps=16, passband=0.16, beta=10.3, steps=512)
MARGIN = WIDE.taps // 2 + 1
"""Samples needed before the first instant and after the last one."""


def resampled(x: Floats, start: float, step: float, count: int, how: Interpolation = WIDE) -> Floats:
    """`x` [channels, samples] at `count` instants start + k * step, [channels, count].

    In cells: sample n is at n + 1/2. MARGIN samples must lie before and after the instants, else IndexError. In C where
    there is a compiler (`kernel/quality.c`); both ways agree to rounding.
    """
    first, last = (math.floor(start - 0.5 + step * k) for k in (0, count - 1))
    if first < how.taps // 2 - 1 or last + how.taps // 2 >= x.shape[1]:
        raise IndexError(f"instants {first} .. {last} need samples beyond the {x.shape[1]} that are there")
    library = quality_library()
    if library is None or len(x) > _LANES:
        return resampled_by_numpy(x, start, step, count, how)
    x = as_rows(x)
    result, scratch = np.empty((len(x), count)), np.empty((x.shape[1], _LANES))
    library.acqd_resample(
        *rows_of(x), start - 0.5, step, count, how.rows.ctypes.data, how.taps, how.steps,
        scratch.ctypes.data, result.ctypes.data,
    )  # fmt: skip
    return result


def resampled_by_numpy(x: Floats, start: float, step: float, count: int, how: Interpolation = WIDE) -> Floats:
    """The same without C: the reference."""
    at = start - 0.5 + step * np.arange(count)
    whole = np.floor(at).astype(np.int64)
    weights = _weights(at - whole, how)
    first = whole - (how.taps // 2 - 1)
    result = np.zeros((len(x), count))
    for tap in range(how.taps):
        result += weights[tap] * np.take(x, first + tap, axis=1)
    return result


def _weights(fraction: Floats, how: Interpolation) -> Floats:
    """[taps, instants]."""
    position = fraction * how.steps
    row = position.astype(np.int64)
    share = (position - row)[:, None]
    return np.asarray((how.rows[row] * (1 - share) + how.rows[row + 1] * share).T)
