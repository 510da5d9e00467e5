"""Blocks between a device and MAIN_FAST: bounded, and handed out in portions."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from acqd.metering import SampleBlock, StreamFormat


class BlockQueue:
    """First in, first out. When full, the oldest blocks go: their samples show as a gap."""

    def __init__(self, form: StreamFormat, seconds: float = 2.0) -> None:
        """Hold at most `seconds` of samples."""
        self._form = form
        self._room = round(seconds * form.rate)
        self._blocks: deque[SampleBlock] = deque()
        self._held = 0
        self._nothing = SampleBlock(np.empty((0, len(form.scale)), dtype=form.dtype), 0, 0)
        self.dropped = 0
        """Samples given up because nobody took them."""

    def put(self, block: SampleBlock) -> None:
        """Append a block."""
        self._blocks.append(block)
        self._held += len(block.codes)
        while self._held > self._room and len(self._blocks) > 1:
            oldest = self._blocks.popleft()
            self._held -= len(oldest.codes)
            self.dropped += len(oldest.codes)

    def take(self, limit: int) -> SampleBlock:
        """The oldest block, at most `limit` samples of it; an empty block when nothing waits."""
        if not self._blocks:
            return self._nothing
        block = self._blocks.popleft()
        if len(block.codes) > limit:
            block, rest = self._split(block, limit)
            self._blocks.appendleft(rest)
        self._held -= len(block.codes)
        return block

    def _split(self, block: SampleBlock, limit: int) -> tuple[SampleBlock, SampleBlock]:
        later = block.utc_ns + round(limit * 1e9 / self._form.rate)
        rest = replace(block, codes=block.codes[limit:], index=block.index + limit, utc_ns=later, lost=0)
        return replace(block, codes=block.codes[:limit]), rest
