"""Urms(1/2) of IEC 61000-4-30: the RMS voltage of one cycle, renewed every half cycle, channel by channel.

The cycles begin at zero crossings of the fundamental (`cycle_clock`). Every half cycle has a value, also without a
voltage: an interruption has values near zero and a duration.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.quality.cycle_clock import CycleClock


@dataclass(frozen=True, slots=True)
class HalfCycles:
    """Values of an unbroken run of samples, per channel: they are not simultaneous."""

    begin: list[Floats]
    """[phases][values] sample number (with fraction) at which each value's cycle begins."""
    end: list[Floats]
    """[phases][values] sample number at which it ends."""
    Urms: list[Floats]
    """[phases][values] V."""
    late: list[Floats]
    """[phases][values] V^2: mean square of the second half of each cycle. These do not overlap."""
    first: bool = False
    """Nothing is known of the time before: the stream begins here, or samples are missing."""
    last: bool = False
    """Samples are missing afterwards."""

    def __len__(self) -> int:
        return sum(len(values) for values in self.Urms)


class HalfCycleStream:
    """Cuts a stream of blocks into cycles; holds no more samples than a block and three cycles."""

    def __init__(self, form: StreamFormat) -> None:
        self._form = form
        self._scale = np.asarray(form.scale[0::2])
        self._carrier = 2 * math.pi * form.f_nominal / form.rate
        self._turning = np.empty(0, complex)
        self._restart()

    def _restart(self) -> None:
        self._codes: Codes | None = None  # of the U channels
        self._origin = 0
        self._first = True
        self._clocks = [CycleClock(self._form.rate, self._form.f_nominal) for _ in self._scale]

    def feed(self, block: SampleBlock) -> Iterator[HalfCycles]:
        """The values that `block` completes; a gap before it ends one run of values and begins another."""
        u = block.codes[:, 0::2]
        if self._codes is not None and block.index != self._origin + len(self._codes):
            nothing = [np.empty(0)] * len(self._scale)
            yield HalfCycles(nothing, nothing, nothing, nothing, last=True)
            self._restart()
        if self._codes is None:
            self._codes, self._origin = u, block.index
        else:
            self._codes = np.concatenate((self._codes, u))
        if not self._clocks[0].locked and len(self._codes) < self._clocks[0].need():
            return
        values = self._values(np.asarray(self._codes.T * self._scale[:, None]))
        self._forget()
        if len(values):
            self._first = False
            yield values

    def _values(self, u: Floats) -> HalfCycles:
        begin, end, Urms, late = [], [], [], []
        if len(self._turning) < u.shape[1]:
            self._turning = np.exp(-1j * self._carrier * np.arange(2 * u.shape[1]))
        turning = self._turning[: u.shape[1]]
        for channel, clock in zip(u, self._clocks, strict=True):
            if not clock.locked:
                clock.lock(channel, self._origin)
            square = channel * channel
            integral, power = _cumulative(channel * turning), _cumulative(square)
            # The line through a cut cell needs the samples on both sides.
            end_of_known = self._origin + len(channel) - 2
            cycles = clock.cycles(self._origin, integral, power, self._carrier, end_of_known)
            starts, stops = np.array(cycles).reshape(-1, 2).T
            begin.append(starts)
            end.append(stops)
            whole, half = _mean_squares(power, square, starts - self._origin, stops - self._origin)
            Urms.append(np.sqrt(whole))
            late.append(half)
        return HalfCycles(begin, end, Urms, late, first=self._first)

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
