"""Short blocks joined to longer ones: a block costs more than its samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.metering.block import SampleBlock


class Gathered:
    """Blocks of one stream wait here until they are `least` samples together."""

    def __init__(self, least: int) -> None:
        self._least, self._count = least, 0
        self._waiting: list[SampleBlock] = []

    def add(self, block: SampleBlock) -> Iterator[SampleBlock]:
        """What is long enough with `block`, and what is short because `block` does not continue it: a gap is between
        the two, the clock has stepped, or other flags hold.
        """
        if self._waiting and not self._continues(block):
            yield from self.rest()
        self._waiting.append(block)
        self._count += len(block.codes)
        if self._count >= self._least:
            yield from self.rest()

    def rest(self) -> Iterator[SampleBlock]:
        """What waits, however short."""
        waiting, self._waiting, self._count = self._waiting, [], 0
        if len(waiting) > 1:
            yield replace(waiting[0], codes=np.concatenate([block.codes for block in waiting]))
        else:
            yield from waiting

    def _continues(self, block: SampleBlock) -> bool:
        first = self._waiting[0]
        return (
            block.index == first.index + self._count
            and block.flags == first.flags
            and block.codes.dtype == first.codes.dtype
            and "clock_step" not in block.flags
        )
