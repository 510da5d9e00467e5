"""Short blocks that travel together."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acqd.metering import SampleBlock
from acqd.metering.gathered import Gathered

_FLAGS = (frozenset[str](), frozenset({"late"}), frozenset({"clock_step"}))


@given(
    blocks=st.lists(st.tuples(st.integers(1, 7), st.integers(0, 1), st.sampled_from(_FLAGS)), max_size=30),
    least=st.integers(1, 20),
)
def test_samples_numbers_times_and_flags_survive(blocks, least):
    """Each sample as (number, UTC, flags, code): a clock step changes the time of what follows."""
    given_blocks, index, offset = [], 0, 0
    for length, gap, flags in blocks:
        index += gap
        offset += 500 if "clock_step" in flags else 0
        codes = np.arange(index, index + length, dtype=np.int16).reshape(-1, 1)
        given_blocks.append(SampleBlock(codes, index, 10 * index + offset, gap, flags))
        index += length
    gathered = Gathered(least)
    taken = [one for block in given_blocks for one in gathered.add(block)]
    assert all(len(one.codes) >= least or not _continued(one, given_blocks) for one in taken)
    taken += gathered.rest()
    assert _samples(taken) == _samples(given_blocks)
    assert sum(one.lost for one in taken) == sum(block.lost for block in given_blocks)
    assert not list(gathered.rest())


def _samples(blocks: list[SampleBlock]) -> list[tuple[int, int, frozenset[str], int]]:
    return [
        (block.index + k, block.utc_ns + 10 * k, block.flags, int(code))
        for block in blocks
        for k, (code,) in enumerate(block.codes)
    ]


def _continued(one: SampleBlock, blocks: list[SampleBlock]) -> bool:
    """Whether the block that begins behind `one` could have been joined to it."""
    after = [block for block in blocks if block.index == one.index + len(one.codes)]
    return bool(after) and after[0].flags == one.flags and "clock_step" not in one.flags
