"""The flickermeter of IEC 61000-4-15 (edition 2): how much a lamp at this voltage would annoy.

Blocks of the standard: 1 normalisation to the mean voltage (first order, 27.3 s), 2 squaring, 3 filters of lamp, eye
and brain, 4 squaring and smoothing (Pinst), 5 statistics (Pst, Plt). After block 2 the mean over some 0.5 ms is enough:
what is above 42 Hz is filtered out anyway.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.quality.lamp import LAMPS, LampName, calibration, demodulation, perception
from acqd.metering.quality.linear_filter import LinearFilter, bilinear
from acqd.metering.quality.mean_squares import mean_squares, mean_squares_of_codes
from acqd.metering.quality.severity import SHORT_S, Severity, short_term

_INNER_RATE = 2_000.0  # 1/s, at least, of the filters
_OUTER_RATE = 200.0  # 1/s, about, of Pinst; the standard wants 50 or more
_MEAN_S = 27.3  # time constant of the normalisation: one minute from 10 to 90 %
_PIECE = 1024  # inner samples, half a second, filtered at once
_AWAY = 0.25  # share of the mean square below which the voltage is away: the normalisation waits
SETTLING_S = 10.0
"""After the start and after a gap, Pinst does not count for so long."""
_AT_ONCE_S = 10.0  # of a block, as double numbers
_ENOUGH = 0.5  # share of an interval without which it has no Pst


class PinstStream:
    """Instantaneous flicker sensation of an unbroken stream of voltages."""

    def __init__(self, phases: int, rate: float, f_nominal: float, lamp: LampName) -> None:
        self.step = max(1, int(rate / _INNER_RATE))
        inner = rate / self.step
        self.thin = max(1, round(inner / _OUTER_RATE))
        """Inner samples per value of Pinst."""
        self._mean = LinearFilter([bilinear([1.0], [_MEAN_S, 1.0], inner)], phases)
        self._weighting = LinearFilter(demodulation(LAMPS[lamp], f_nominal, inner), phases)
        self._smoothing = LinearFilter([perception(inner)], phases)
        self._scale = calibration(LAMPS[lamp], f_nominal)
        self._level: Floats | None = None
        self.away = False
        """Whether the voltage of a phase was away in the last call."""

    def feed(self, u: Floats) -> Floats:
        """[phases, samples], a multiple of `step * thin`, in V -> Pinst [phases, samples / step / thin]."""
        return self.feed_squares(mean_squares(u, self.step))

    def feed_squares(self, squares: Floats) -> Floats:
        """The same of mean squares over `step` samples each, [phases, a multiple of `thin`] V^2."""
        self.away = False
        pieces = [self._piece(squares[:, k : k + _PIECE]) for k in range(0, squares.shape[1], _PIECE)]
        return np.concatenate(pieces, axis=1)[:, :: self.thin] if pieces else np.empty((len(squares), 0))

    def _piece(self, square: Floats) -> Floats:
        now = square.mean(axis=1)
        if self._level is None:
            self._level = now
            self._mean.settle(now)
            self._weighting.settle(np.ones(len(now)))
        away = now < _AWAY * self._level
        self.away |= bool(away.any())
        mean = self._mean.feed(np.where(away[:, None], self._level[:, None], square))
        self._level = mean[:, -1]
        fluctuation = self._weighting.feed(square / np.maximum(mean, 1e-30))
        return self._scale * self._smoothing.feed(fluctuation * fluctuation)


class FlickerMeter:
    """Pst of ten-minute intervals, from a stream of blocks; holds ten minutes of Pinst, 200 values a second."""

    def __init__(self, form: StreamFormat, lamp: LampName = "230V", *, on_the_clock: bool = True) -> None:
        """`on_the_clock`: intervals begin at whole ten minutes of UTC, else when the filters have settled."""
        self._form, self._lamp, self._on_the_clock = form, lamp, on_the_clock
        self._slot: int | None = None
        self._offset: int | None = None if not on_the_clock else 0
        self._flags: set[str] = set()
        self._Pinst: list[Floats] = []
        self._count = 0
        self._next: int | None = None
        self._restart()

    def _restart(self) -> None:
        form = self._form
        self._stream = PinstStream(form.phases, form.rate, form.f_nominal, self._lamp)
        self._chunk = self._stream.step * self._stream.thin
        self._rest: Codes | None = None
        self._settling = round(SETTLING_S * form.rate / self._chunk)

    @property
    def rate(self) -> float:
        """Values of Pinst per second."""
        return self._form.rate / self._chunk

    def feed(self, block: SampleBlock) -> Iterator[Severity]:
        """The intervals that `block` completes. A long block is filtered in pieces: it may be a whole recording."""
        size = max(self._chunk, round(_AT_ONCE_S * self._form.rate))
        for first in range(0, len(block.codes), size):
            codes = block.codes[first : first + size]
            utc_ns = block.utc_ns + round(first * 1e9 / self._form.rate)
            yield from self._feed(replace(block, codes=codes, index=block.index + first, utc_ns=utc_ns))

    def _feed(self, block: SampleBlock) -> Iterator[Severity]:
        if self._next is not None and block.index != self._next:
            self._flags.add("gap")
            self._restart()
        self._next = block.index + len(block.codes)
        codes, begin = block.codes, block.index
        if self._rest is not None:
            codes, begin = np.concatenate((self._rest, codes)), begin - len(self._rest)
        whole = len(codes) // self._chunk * self._chunk
        self._rest = codes[whole:].copy() if whole < len(codes) else None
        Pinst = self._stream.feed_squares(mean_squares_of_codes(codes[:whole], self._form, self._stream.step))
        skipped = min(self._settling, Pinst.shape[1])
        self._settling -= skipped
        at = begin + (skipped + np.arange(Pinst.shape[1] - skipped)) * self._chunk
        utc = block.utc_ns + np.rint((at - block.index) * 1e9 / self._form.rate).astype(np.int64)
        yield from self._sort(Pinst[:, skipped:], utc)
        self._flags |= {"interruption"} if self._stream.away else set()
        self._flags |= block.flags & {"simulated"}

    def _sort(self, Pinst: Floats, utc: np.ndarray) -> Iterator[Severity]:
        """Into the intervals that the values belong to."""
        if not len(utc):
            return
        if self._offset is None:
            self._offset = int(utc[0]) % (SHORT_S * 1_000_000_000)
        slots = (utc - self._offset) // (SHORT_S * 1_000_000_000)
        for slot in range(int(slots[0]), int(slots[-1]) + 1):
            if self._slot is not None and slot != self._slot:
                yield self._finish()
            self._slot = slot
            mine = Pinst[:, slots == slot]
            self._Pinst.append(mine)
            self._count += mine.shape[1]

    def _finish(self) -> Severity:
        """The interval that is over."""
        assert self._slot is not None and self._offset is not None
        expected = SHORT_S * self.rate
        if self._count < 0.999 * expected:
            self._flags.add("gap")
        enough = self._count >= _ENOUGH * expected
        value = short_term(np.concatenate(self._Pinst, axis=1)) if enough else np.full(self._form.phases, np.nan)
        result = Severity(
            self._slot * SHORT_S * 1_000_000_000 + self._offset, float(SHORT_S), value, frozenset(self._flags)
        )
        self._Pinst, self._count, self._flags = [], 0, set()
        return result
