"""The newest samples that MAIN_SLOW has metered, for readers in other threads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.block import Codes
from acqd.metering.window import WindowGrid

_WINDOWS = 3
"""Windows kept: the block in progress ends anywhere within a window, and a whole one must lie before it."""


@dataclass(frozen=True, slots=True)
class SampledWindow:
    """The samples of one window."""

    form: StreamFormat
    seq: int
    """Number of the window in the stream, as in its rows."""
    utc_ns: int
    """UTC of the first sample [ns]."""
    codes: Codes
    """[samples, 2 * phases]; times `form.scale` they are V and A."""
    flags: frozenset[str]


class RecentSamples:
    """Keeps references to the newest blocks: nothing is copied until somebody asks.

    One thread adds, any thread reads: the blocks are one tuple, which is replaced as a whole.
    """

    def __init__(self, form: StreamFormat, window: float) -> None:
        """`window` [s]: length of the metered windows."""
        self._form = form
        self._grid = WindowGrid(form.rate, window)
        self._least = int(_WINDOWS * window * form.rate) + 1
        self._blocks: tuple[SampleBlock, ...] = ()

    def add(self, block: SampleBlock) -> None:
        """The next block; a gap before it makes the earlier ones useless."""
        last = self._blocks[-1] if self._blocks else None
        unbroken = last is not None and block.index == last.index + len(last.codes)
        blocks = (*self._blocks, block) if unbroken else (block,)
        enough = block.index + len(block.codes) - self._least  # for blocks that begin no later
        while len(blocks) > 1 and blocks[1].index <= enough:
            blocks = blocks[1:]
        self._blocks = blocks

    def window(self) -> SampledWindow | None:
        """A copy of the newest whole window; None before the first, and until one is whole after a gap."""
        blocks = self._blocks
        if not blocks:
            return None
        end = blocks[-1].index + len(blocks[-1].codes)
        number = self._grid.containing(end) - 1
        start, stop = self._grid.start(number), self._grid.start(number + 1)
        if start < blocks[0].index:
            return None
        touched = [each for each in blocks if each.index < stop and each.index + len(each.codes) > start]
        codes = np.concatenate([each.codes[max(0, start - each.index) : stop - each.index] for each in touched])
        first = touched[0]
        utc_ns = first.utc_ns + round((start - first.index) * 1e9 / self._form.rate)
        flags = frozenset().union(*(each.flags for each in touched))
        return SampledWindow(self._form, number, utc_ns, codes, flags)
