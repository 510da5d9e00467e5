"""The queue between a device and the reader."""

from __future__ import annotations

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering import SampleBlock
from acqd.sources.queue import BlockQueue
from tests.sources.counted import FORM, counted


@settings(max_examples=100)
@given(sizes=st.lists(st.integers(1, 300), min_size=1, max_size=30), limits=st.lists(st.integers(1, 200), min_size=1))
def test_the_queue_hands_every_sample_out_in_order_whatever_the_portions(sizes, limits):
    queue, index = BlockQueue(FORM, seconds=1.0), 0
    for size in sizes:
        queue.put(SampleBlock(counted(index, size), index, index * 50_000))
        index += size
    got: list[int] = []
    for limit in itertools.chain(limits, itertools.repeat(1_000)):
        block = queue.take(limit)
        if not len(block.codes):
            break
        assert len(block.codes) <= limit
        assert block.utc_ns == block.index * 50_000
        got += range(block.index, block.index + len(block.codes))
    assert got == list(range(index)) and queue.dropped == 0


def test_a_full_queue_gives_up_the_oldest_and_counts_them():
    queue = BlockQueue(FORM, seconds=0.01)
    for number in range(10):
        queue.put(SampleBlock(counted(100 * number, 100), 100 * number, 0))
    assert queue.dropped == 800 and queue.take(1_000).index == 800
