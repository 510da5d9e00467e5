"""Many frames of one stream at once: counters, codes and flags as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.metering.block import WIDE_CODE_MAX
from acqd.sources.sampled_values.frame import FrameLayout

# Quality as 9-2LE maps the bits of IEC 61850-7-3 to an unsigned 32-bit word.
_VALIDITY, _OVERFLOW, _OUT_OF_RANGE, _TEST = 0b11, 1 << 2, 1 << 3, 1 << 11
INVALID, OVERRANGE, TEST, CLOCK_UNLOCKED, SIMULATED = (1 << bit for bit in range(5))
_NAMES = {INVALID: "invalid", OVERRANGE: "overrange", TEST: "test", CLOCK_UNLOCKED: "clock_unlocked"}
_NAMES[SIMULATED] = "simulated"


@dataclass(frozen=True, slots=True)
class Samples:
    """Consecutive frames, decoded; one line per sample."""

    counter: NDArray[np.int64]
    """smpCnt."""
    codes: NDArray[np.int32]
    """[samples, channels]."""
    flags: NDArray[np.int64]
    """Bits as above."""


class Decoder:
    """Decodes frames that have the layout of one template frame."""

    def __init__(self, layout: FrameLayout, template: bytes, channels: tuple[int, ...]) -> None:
        """`channels`: which values of the data set are U1, I1, U2, I2, ..."""
        self.layout = layout
        self.appid = np.frombuffer(template, dtype=np.uint8)[14:16]
        """Its two bytes in the frame."""
        self._channels = list(channels)
        constant = np.ones(layout.length, dtype=bool)
        constant[:14] = False  # addresses: redundant networks repeat a frame from another port
        constant[18:20] = False  # reserved 1: the simulate bit
        for asdu in layout.asdus:
            constant[asdu.smp_cnt : asdu.smp_cnt + 2] = False
            constant[asdu.smp_synch] = False
            constant[asdu.samples : asdu.samples + 8 * asdu.values] = False
            if asdu.refr_tm is not None:
                constant[asdu.refr_tm : asdu.refr_tm + 8] = False
        self._constant = np.flatnonzero(constant)
        self._expected = np.frombuffer(template, dtype=np.uint8)[self._constant]

    def matching(self, frames: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which of the frames [frames, length] belong to the stream, byte for byte outside of its data."""
        return np.asarray((frames[:, self._constant] == self._expected).all(axis=1))

    def decode(self, frames: NDArray[np.uint8]) -> Samples:
        """The samples of matching frames [frames, length], in the order of arrival."""
        parts = [self._asdu(frames, position) for position in range(len(self.layout.asdus))]
        order = np.arange(len(frames) * len(parts)).reshape(len(parts), -1).T.ravel()
        return Samples(*(np.concatenate(columns)[order] for columns in zip(*parts, strict=True)))

    def _asdu(
        self, frames: NDArray[np.uint8], position: int
    ) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]]:
        asdu = self.layout.asdus[position]
        counter = frames[:, asdu.smp_cnt].astype(np.int64) << 8 | frames[:, asdu.smp_cnt + 1]
        data = np.ascontiguousarray(frames[:, asdu.samples : asdu.samples + 8 * asdu.values])
        words = data.view(">u4").reshape(len(frames), asdu.values, 2)[:, self._channels]
        values = words[:, :, 0].astype(np.uint32).view(np.int32)
        quality = np.bitwise_or.reduce(words[:, :, 1], axis=1).astype(np.int64)
        flags = np.where(quality & _VALIDITY, INVALID, 0)
        flags |= np.where(quality & (_OVERFLOW | _OUT_OF_RANGE), OVERRANGE, 0)
        flags |= np.where(quality & _TEST, TEST, 0)
        flags |= np.where(frames[:, asdu.smp_synch] == 0, CLOCK_UNLOCKED, 0)
        flags |= np.where(frames[:, 18] & 0x80, SIMULATED, 0)
        return counter, np.clip(values, -WIDE_CODE_MAX, WIDE_CODE_MAX), flags


def names(bits: int) -> frozenset[str]:
    """Row flags of flag bits."""
    return frozenset(name for bit, name in _NAMES.items() if bits & bit)
