"""What an interval needs of its samples: integrals over its half cycles, from which all RMS values and powers follow.

Half cycles lie next to each other, so every sample is counted once; a cycle is two of them, renewed every half cycle
(IEC 61000-4-30, section 5.4.1), and the interval is all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering.interval import interval_sums
from acqd.metering.kernel.compiled import as_rows, quality_library, rows_of


@dataclass(frozen=True, slots=True)
class HalfCycleIntegrals:
    """Integrals over consecutive half cycles, in units times samples."""

    half: float
    """Samples of a half cycle."""
    squares: Floats
    """[channels, halves] of U1, I1, U2 ..."""
    products: Floats
    """[phases, halves] of u i."""
    lines: Floats
    """[3, halves] of (u1 - u2)^2, (u2 - u3)^2, (u3 - u1)^2; [1, halves] with two phases, [0, halves] with one."""
    neutral: Floats
    """[halves] of (i1 + i2 + i3)^2; empty without three phases."""
    lowest: Floats
    """[channels] smallest value, in units."""
    highest: Floats
    """[channels] largest value, in units."""

    @property
    def peaks(self) -> Floats:
        """[channels] largest absolute value."""
        return np.asarray(np.maximum(-self.lowest, self.highest))

    def mean(self, integrals: Floats) -> Floats:
        """Mean over the interval of one of the fields, along its last axis."""
        return np.asarray(integrals.sum(axis=-1) / (self.half * integrals.shape[-1]))

    def rms(self, integrals: Floats) -> Floats:
        """Root of that mean; the line through a cut cell can dip below zero where the voltage has just gone."""
        return np.asarray(np.sqrt(np.maximum(self.mean(integrals), 0.0)))

    def one_cycle_rms(self) -> Floats:
        """RMS of the voltages over each cycle, every half cycle: [phases, halves - 1]."""
        u = self.squares[0::2]
        return np.asarray(np.sqrt(np.maximum((u[:, :-1] + u[:, 1:]) / (2 * self.half), 0.0)))


def half_cycle_integrals(x: Floats, start: float, half: float, halves: int) -> HalfCycleIntegrals:
    """Of `x` [channels, samples] from `start` on; in C where there is a compiler (`kernel/quality.c`)."""
    library = quality_library()
    if library is None:
        return half_cycle_integrals_by_numpy(x, start, half, halves)
    phases = len(x) // 2
    out, extremes, scratch = np.empty((_series(phases), halves)), np.empty((2, len(x))), np.empty(x.shape[1])
    x = as_rows(x)
    address, _, stride, samples = rows_of(x)
    library.acqd_half_cycle_integrals(
        address, phases, stride, samples, start, half, halves,
        scratch.ctypes.data, out.ctypes.data, extremes.ctypes.data,
    )  # fmt: skip
    return _split(out, phases, half, extremes)


def half_cycle_integrals_by_numpy(x: Floats, start: float, half: float, halves: int) -> HalfCycleIntegrals:
    """The same without C: the reference."""
    u, i = x[0::2], x[1::2]
    begins = np.asarray(start + half * np.arange(halves))
    series = [x * x, u * i]
    if len(u) == 3:
        series += [np.square(u - u[[1, 2, 0]]), np.square(i.sum(axis=0, keepdims=True))]
    elif len(u) == 2:
        series.append(np.square(u[:1] - u[1:]))
    inside = slice(int(start), int(np.ceil(start + half * halves)))
    out = interval_sums(np.concatenate(series), begins, np.asarray(start + half * np.arange(1, halves + 1)))
    extremes = np.stack((x[:, inside].min(axis=1), x[:, inside].max(axis=1)))
    return _split(out, len(u), half, extremes)


def _series(phases: int) -> int:
    return 3 * phases + (0, 0, 1, 4)[phases]


def _split(out: Floats, phases: int, half: float, extremes: Floats) -> HalfCycleIntegrals:
    squares, products, rest = out[: 2 * phases], out[2 * phases : 3 * phases], out[3 * phases :]
    neutral = rest[3] if phases == 3 else rest[:0].ravel()
    return HalfCycleIntegrals(half, squares, products, rest[:3], neutral, extremes[0], extremes[1])
