"""Correction of gain, offset and delay of every channel before metering.

Current and voltage transformers turn the phase: 10 us between U and I is 0.54 % of the energy at a power factor of 0.5
(50 Hz). A channel that is late by d is read d later, by Lagrange interpolation over eight samples;
all channels then lag by a few samples, in which no row is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.delay import POINTS, weights
from acqd.metering.packed import State, packed, unpacked

_BEFORE = POINTS // 2 - 1
"""Samples before a position that its interpolation reads."""


@dataclass(frozen=True, slots=True)
class ChannelErrors:
    """What is wrong with the channels, in the order U1, I1, U2, I2 ..."""

    gain: Sequence[float]
    """True value per measured value; negative for a reversed transformer."""
    offset: Sequence[float]
    """Measured value where the true one is zero [V or A]."""
    delay_s: Sequence[float]
    """How much later than the mains the channel's samples are [s]; negative: earlier."""


class Correction:
    """Corrects the blocks of one stream, in order."""

    def __init__(self, form: StreamFormat, errors: ChannelErrors) -> None:
        """Raises ValueError for another number of channels, or delays that are longer than a millisecond."""
        if not len(form.scale) == len(errors.gain) == len(errors.offset) == len(errors.delay_s):
            raise ValueError(f"correction of {len(errors.gain)} channels, but the stream has {len(form.scale)}")
        if max(map(abs, errors.delay_s)) > 1e-3:
            raise ValueError("correction: delays of more than 1000 us are no errors of a transformer")
        self._input = form
        scale = tuple(s * abs(gain) for s, gain in zip(form.scale, errors.gain, strict=True))
        self._sign = np.sign(errors.gain)
        self._shifts = np.array(errors.delay_s) * form.rate
        self._offset = np.array(errors.offset) / np.array(form.scale)
        self._only_gain = not (self._shifts.any() or self._offset.any() or (self._sign < 0).any())
        self.form = replace(form, scale=scale, bits=form.bits if self._only_gain else 64)
        """What the corrected codes mean."""
        whole = np.floor(self._shifts).astype(int)
        self._first = int(min(0, whole.min() - _BEFORE))
        self._last = int(max(0, whole.max() + POINTS - 1 - _BEFORE))
        self._starts = whole - _BEFORE - self._first
        self._weights = np.array([weights(share) for share in self._shifts - whole])
        self._kept: Floats = np.empty((0, len(form.scale)))
        self._next = -1  # index after the newest sample
        self._pending: frozenset[str] = frozenset()
        self._expected: int | None = None  # index after the newest corrected sample

    def apply(self, block: SampleBlock) -> SampleBlock | None:
        """The corrected samples that `block` completes; None if it completes no sample.

        After a gap, the first samples have no neighbours to be interpolated from: the gap is so much longer.
        """
        if self._only_gain:
            return block
        flags = self._pending | block.flags | ({"overrange"} if block.overrange(self._input) else frozenset())
        codes = (block.codes - self._offset) * self._sign
        if block.index != self._next:  # a gap, or the beginning
            self._kept = codes[:0]
        self._next = block.index + len(codes)
        x = np.concatenate((self._kept, codes))
        count = len(x) - (self._last - self._first)
        self._kept = x[max(count, 0) :]
        self._pending = frozenset() if count > 0 else flags  # of a short block: they hold for the next samples
        if count <= 0:
            return None
        index = self._next - len(x) - self._first
        utc_ns = block.utc_ns + round((index - block.index) * 1e9 / self.form.rate)
        lost = 0 if self._expected is None else index - self._expected
        self._expected = index + count
        return SampleBlock(self._interpolated(x, count), index, utc_ns, lost, flags)

    def state(self) -> State:
        """What is known of the stream so far."""
        return {
            "kept": packed(self._kept), "next": self._next, "pending": sorted(self._pending), "expected": self._expected
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self._kept, self._next = unpacked(state["kept"]).astype(np.float64), state["next"]
        self._pending, self._expected = frozenset(state["pending"]), state["expected"]

    def _interpolated(self, x: Floats, count: int) -> Floats:
        """[count, channels] from [count + last - first, channels]."""
        result = np.zeros((count, x.shape[1]))
        for channel, start in enumerate(self._starts):
            for k, weight in enumerate(self._weights[channel]):
                result[:, channel] += weight * x[start + k : start + k + count, channel]
        return result


class Reordered:
    """Takes the currents of the phases from other channels: transformers that are exchanged."""

    def __init__(self, form: StreamFormat, order: Sequence[int]) -> None:
        """`order` [phases]: number of the channel, from 1, whose current is that of L1, L2, L3. Raises ValueError."""
        if sorted(order) != list(range(1, form.phases + 1)):
            raise ValueError(f"i_order {list(order)}: expected the numbers 1 to {form.phases}, each once")
        self._places = [place for phase, k in enumerate(order) for place in (2 * phase, 2 * k - 1)]
        self.form = replace(form, scale=tuple(form.scale[place] for place in self._places))
        """What the codes mean in the new order."""

    def state(self) -> State:
        """Nothing: every sample is by itself."""
        return {}

    def restore(self, _: State) -> None:
        """Go on."""

    def apply(self, block: SampleBlock) -> SampleBlock:
        """The same samples in the new order."""
        return replace(block, codes=np.ascontiguousarray(block.codes[:, self._places]))
