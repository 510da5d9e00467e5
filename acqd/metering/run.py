"""Blocks that follow each other as one, which costs as much as one of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from acqd.metering.block import SampleBlock


@dataclass(frozen=True, slots=True)
class Run:
    """Blocks without a gap, with the same flags, whose times follow from the first one."""

    block: SampleBlock
    """The samples of all."""
    edges: list[int]
    """Positions of the cuts, from 0 to the number of samples."""

    def blocks(self, rate: float) -> Iterator[SampleBlock]:
        """As they were cut; `rate` in samples/s."""
        whole, utc_ns, lost = self.block, self.block.utc_ns, self.block.lost
        for begin, end in pairwise(self.edges):
            yield SampleBlock(whole.codes[begin:end], whole.index + begin, utc_ns, lost, whole.flags)
            utc_ns, lost = after(utc_ns, end - begin, rate), 0


def after(utc_ns: int, samples: int, rate: float) -> int:
    """UTC [ns] so many samples later."""
    return utc_ns + round(samples * 1e9 / rate)
