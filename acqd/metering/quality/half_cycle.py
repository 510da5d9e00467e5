"""Urms(1/2) of IEC 61000-4-30: the RMS voltage of one cycle, renewed every half cycle, channel by channel.

The cycles begin at zero crossings of the fundamental (`cycle_clock`). Every half cycle has a value, also without a
voltage: an interruption has values near zero and a duration.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator
from ctypes import Array
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.kernel.compiled import quality_library
from acqd.metering.quality.clock_state import RULES_AT, ClockState, give_back, states_of
from acqd.metering.quality.cycle_clock import CycleClock


@dataclass(frozen=True, slots=True)
class HalfCycles:
    """Values of an unbroken run of samples, per channel: they are not simultaneous."""

    phases: list[Floats]
    """[phases][values, 4]: sample number (with fraction) at which each value's cycle begins, the one at which it ends,
    RMS [V], and mean square [V^2] of the second half of the cycle. These halves do not overlap."""
    first: bool = False
    """Nothing is known of the time before: the stream begins here, or samples are missing."""
    last: bool = False
    """Samples are missing afterwards."""

    def __len__(self) -> int:
        return sum(len(values) for values in self.phases)

    @property
    def begin(self) -> list[Floats]:
        """[phases][values] sample number at which each value's cycle begins."""
        return [values[:, 0] for values in self.phases]

    @property
    def end(self) -> list[Floats]:
        """[phases][values] sample number at which it ends."""
        return [values[:, 1] for values in self.phases]

    @property
    def Urms(self) -> list[Floats]:  # noqa: N802 - the symbol of the standard
        """[phases][values] V."""
        return [values[:, 2] for values in self.phases]

    @property
    def late(self) -> list[Floats]:
        """[phases][values] V^2: mean square of the second half of each cycle."""
        return [values[:, 3] for values in self.phases]


class HalfCycleStream:
    """Cuts a stream of blocks into cycles; holds no more samples than a block and three cycles."""

    def __init__(self, form: StreamFormat, *, compiled: bool = True) -> None:
        """`compiled`: in C where there is a compiler (`kernel/quality.c`); both ways agree to rounding."""
        self._form = form
        self._library = quality_library() if compiled else None
        self._scale = np.array(form.scale[0::2], dtype=np.float64)
        self._carrier = 2 * math.pi * form.f_nominal / form.rate
        self._turning: Floats = np.empty((2, 0))
        self._room = 0
        self._arrays: tuple[Floats, ...] = ()  # whose addresses are in `_call`
        self._call = (0,) * 7
        self._counts = (ctypes.c_int64 * form.phases)()
        self._restart()

    @property
    def cycle(self) -> float | None:
        """Samples of a cycle of the first phase, as far as known; None before its phase is known."""
        return 2 * self._clocks[0].half if self._clocks[0].locked else None

    def _restart(self) -> None:
        self._codes: Codes | None = None  # of the U channels
        self._origin = 0
        self._first = True
        self._clocks = [CycleClock(self._form.rate, self._form.f_nominal) for _ in self._scale]
        self._states: Array[ClockState]

    def feed(self, block: SampleBlock) -> Iterator[HalfCycles]:
        """The values that `block` completes; a gap before it ends one run of values and begins another."""
        u = block.codes[:, 0::2]
        if self._codes is not None and block.index != self._origin + len(self._codes):
            yield HalfCycles([np.empty((0, 4))] * len(self._scale), last=True)
            self._restart()
        if self._codes is None:
            self._codes, self._origin = np.ascontiguousarray(u), block.index
        else:
            self._codes = np.concatenate((self._codes, u))
        if not self._clocks[0].locked and len(self._codes) < self._clocks[0].need():
            return
        in_c = self._library is not None and self._codes.dtype == self._form.dtype
        values = self._values(self._codes) if in_c else self._values_by_numpy(self._codes)
        self._forget()
        if len(values):
            self._first = False
            yield values

    def _values(self, codes: Codes) -> HalfCycles:
        """The values of `codes` [samples, phases], which lie next to each other, in C."""
        assert self._library is not None
        samples, phases = codes.shape
        if not self._clocks[0].locked:
            self._lock(np.asarray(codes.T * self._scale[:, None]))
            self._states = states_of(self._clocks)
        if samples > self._room:
            self._make_room(2 * samples)
        scale, turning, scratch, out, most, length, counts = self._call
        self._library.acqd_half_cycles(
            ctypes.addressof(self._states), RULES_AT, codes.ctypes.data, self._form.bits, phases, samples,
            scale, self._origin, self._carrier, turning, length, scratch, out, most, counts,
        )  # fmt: skip
        give_back(self._states, self._clocks)
        found = zip(self._arrays[3], self._counts, strict=True)
        return HalfCycles([rows[:count].copy() for rows, count in found], self._first)

    def _make_room(self, samples: int) -> None:
        """Memory for so many samples in a call, and the arguments of a call that do not change."""
        self._room, most = samples, self._clocks[0].most(samples)
        turning, out = self._turned(samples), np.empty((len(self._scale), most, 4))
        self._arrays = (self._scale, turning, np.empty(4 * (samples + 1)), out)
        addresses = [array.ctypes.data for array in self._arrays]
        self._call = (*addresses, most, turning.shape[1], ctypes.addressof(self._counts))

    def _lock(self, u: Floats) -> None:
        for channel, clock in zip(u, self._clocks, strict=True):
            clock.lock(channel, self._origin)

    def _turned(self, samples: int) -> Floats:
        """Real and imaginary part of exp(-j carrier k) [2, samples or more]."""
        if self._turning.shape[1] < samples:
            angle = self._carrier * np.arange(2 * samples)
            self._turning = np.stack((np.cos(angle), -np.sin(angle)))
        return self._turning

    def _values_by_numpy(self, codes: Codes) -> HalfCycles:
        """The same without C: the reference."""
        u = np.asarray(codes.T * self._scale[:, None])
        phases = []
        parts = self._turned(u.shape[1])[:, : u.shape[1]]
        turning = parts[0] + 1j * parts[1]
        if not self._clocks[0].locked:
            self._lock(u)
        for channel, clock in zip(u, self._clocks, strict=True):
            square = channel * channel
            integral, power = _cumulative(channel * turning), _cumulative(square)
            # The line through a cut cell needs the samples on both sides.
            end_of_known = self._origin + len(channel) - 2
            cycles = clock.cycles(self._origin, integral, power, self._carrier, end_of_known)
            starts, stops = np.array(cycles).reshape(-1, 2).T
            whole, half = _mean_squares(power, square, starts - self._origin, stops - self._origin)
            phases.append(np.column_stack((starts, stops, np.sqrt(whole), half)))
        return HalfCycles(phases, self._first)

    def _forget(self) -> None:
        """Drop the samples that no later value needs."""
        assert self._codes is not None
        oldest = min((clock.next or 0.0) - 2.2 * clock.half for clock in self._clocks)
        keep = max(0, math.floor(oldest) - 2 - self._origin)
        self._codes, self._origin = self._codes[keep:].copy(), self._origin + keep


def _cumulative(x: np.ndarray) -> np.ndarray:
    result = np.empty(len(x) + 1, x.dtype)
    result[0] = 0
    np.cumsum(x, out=result[1:])
    return result


def _mean_squares(power: Floats, square: Floats, start: Floats, stop: Floats) -> tuple[Floats, Floats]:
    """Of each interval and of its second half; `power` [samples + 1] is the running sum of `square`."""
    middle = (start + stop) / 2
    count = len(start)
    integral = _integral(power, square, np.concatenate((start, middle, stop)))
    first, half, last = integral[:count], integral[count : 2 * count], integral[2 * count :]
    return np.maximum(last - first, 0.0) / (stop - start), np.maximum(last - half, 0.0) / (stop - middle)


def _integral(power: Floats, square: Floats, at: Floats) -> Floats:
    """Of `square` up to the positions `at`; in a cut cell it is the line through its neighbours (`interval`)."""
    cell = np.floor(at).astype(np.int64)
    share, last = at - cell, len(square) - 1
    middle = np.minimum(cell, last)
    slope = (square[np.minimum(middle + 1, last)] - square[np.maximum(middle - 1, 0)]) / 2
    return np.asarray(power[cell] + share * square[middle] + (share * share - share) / 2 * slope)
