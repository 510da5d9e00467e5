"""Unbroken samples of a stream, their time and their flags, from the first one that is still needed."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.kernel.compiled import quality_library


class SampleRun:
    """Positions are sample numbers of the stream; cell [k, k + 1) is sample k."""

    def __init__(self, form: StreamFormat) -> None:
        self._form = form
        self._scale = np.array(form.scale, dtype=np.float64)
        self._codes: Codes = np.empty((0, len(form.scale)), dtype=form.dtype)
        self._anchor = (0, 0)  # sample number, its UTC [ns]
        self._marks: list[tuple[int, int, frozenset[str]]] = []
        self.begin = 0

    @property
    def end(self) -> int:
        """After the last sample."""
        return self.begin + len(self._codes)

    def append(self, block: SampleBlock) -> bool:
        """Take a block; False when it does not follow the last one and so begins another run."""
        follows = len(self._codes) > 0 and block.index == self.end
        if follows:
            self._codes = np.concatenate((self._codes, block.codes))
        else:
            self._codes, self.begin = block.codes, block.index
            self._marks.clear()
        if not follows or "clock_step" in block.flags:
            self._anchor = (block.index, block.utc_ns)
        if block.flags:
            self._marks.append((block.index, block.index + len(block.codes), block.flags))
        return follows

    def forget(self, position: float) -> None:
        """Samples before `position` are needed no more."""
        spare = min(int(position) - self.begin, len(self._codes))
        if spare > 0:
            self._codes, self.begin = self._codes[spare:], self.begin + spare
            self._marks = [mark for mark in self._marks if mark[1] > self.begin]

    def utc_ns(self, position: float) -> int:
        """UTC of a position [ns]."""
        index, utc = self._anchor
        return utc + round((position - index) * 1e9 / self._form.rate)

    def position(self, utc_ns: int) -> float:
        """Position at a time."""
        index, utc = self._anchor
        return index + (utc_ns - utc) * 1e-9 * self._form.rate

    def flags(self, first: float, end: float) -> frozenset[str]:
        """Flags of the blocks that the stretch touches."""
        return frozenset().union(*(named for begin, after, named in self._marks if begin < end and after > first))

    def codes(self, first: float, end: float) -> tuple[Codes, int]:
        """The cells that the stretch touches, and the position of the first one."""
        low, high = max(int(first), self.begin), min(int(np.ceil(end)), self.end)
        return self._codes[low - self.begin : high - self.begin], low

    def physical(self, first: float, end: float) -> tuple[Floats, int]:
        """The same in V and A, [channels, samples]; in C where there is a compiler (`kernel/quality.c`)."""
        codes, low = self.codes(first, end)
        library = quality_library()
        if library is None or codes.dtype != self._form.dtype or not codes.flags.c_contiguous:
            return np.ascontiguousarray(codes.T * self._scale[:, None]), low
        out = np.empty((codes.shape[1], len(codes)))
        samples, channels = codes.shape
        library.acqd_physical(
            codes.ctypes.data, self._form.bits, channels, samples, self._scale.ctypes.data, out.ctypes.data
        )
        return out, low
