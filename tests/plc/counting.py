"""Samples that tell their own index."""

from __future__ import annotations

import numpy as np

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.block import Codes
from acqd.sources import Source

RATE = 20_000.0


def counted(start: int, stop: int) -> Codes:
    """Samples that tell their own index, in two channels."""
    index = np.arange(start, stop)
    return np.column_stack((index % 30_000, index // 30_000)).astype(np.int16)


def index_of(codes: Codes) -> np.ndarray:
    return codes[:, 0].astype(int) + 30_000 * codes[:, 1].astype(int)


class CountingSource(Source):
    """The fake at the protocol: samples that know their number, and gaps on request."""

    form = StreamFormat(RATE, (0.02, 0.0003))

    def __init__(self, gaps: dict[int, int] | None = None, live: bool = False) -> None:
        self.gaps = gaps or {}
        self.live = live

    def open(self, utc_ns: int, index: int = 0) -> None:
        self.utc, self.next = utc_ns, index

    def read(self, limit: int) -> SampleBlock | None:
        self.next += self.gaps.pop(self.next, 0)
        block = SampleBlock(counted(self.next, self.next + limit), self.next, self.utc)
        self.next += limit
        return block
