"""The ring between the fast and the slow process."""

from __future__ import annotations

import os

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.plc.process import RING_S
from acqd.plc.ring import GAP, LATE, STEP, Ring, RingLayout
from tests.plc.counting import RATE, counted, index_of


@settings(max_examples=60)
@given(steps=st.lists(st.tuples(st.integers(0, 3_000), st.booleans(), st.sampled_from([0, 0, 0, 7, 500])), max_size=40))
def test_ring_hands_over_every_sample_in_order_with_its_index(steps):
    ring, fd = Ring.create(RingLayout(RATE, 2, 8_000))  # a quarter of it is kept clear of the reader
    ring.begin(100, 10**9)
    index, seen, written, expected = 100, [], [], 0
    for count, read, gap in steps:
        if gap:
            ring.event(GAP, gap)
            index += gap
        ring.write(counted(index, index + count))
        written += range(index, index + count)
        index += count
        expected += count
        if read or expected > 1_500:
            for block in ring.read():
                np.testing.assert_array_equal(index_of(block.codes), block.index + np.arange(len(block.codes)))
                assert block.utc_ns == 10**9 + (block.index - 100) * 50_000
                seen += range(block.index, block.index + len(block.codes))
            expected = 0
    for block in ring.read():
        seen += range(block.index, block.index + len(block.codes))
    assert seen == written
    os.close(fd)


def test_ten_seconds_of_samples_wait_for_the_reader():
    ring, fd = Ring.create(RingLayout(RATE, 2, int(RING_S * RATE)))
    ring.begin(0, 0)
    for millisecond in range(10_000):
        if millisecond % 2:
            ring.event(LATE)
        ring.write(counted(20 * millisecond, 20 * millisecond + 20))
    blocks = ring.read()
    assert sum(len(block.codes) for block in blocks) == 200_000 and not any(block.lost for block in blocks)
    assert sum("late" in block.flags for block in blocks) == 5_000
    os.close(fd)


def test_a_reader_kept_away_too_long_sees_a_gap_not_garbage(ring):
    ring.begin(0, 0)
    ring.write(counted(0, 15_000))
    ring.write(counted(15_000, 30_000))
    (block,) = ring.read()
    assert block.lost == block.index > 0
    np.testing.assert_array_equal(index_of(block.codes), block.index + np.arange(len(block.codes)))
    assert block.index + len(block.codes) == 30_000


def test_events_travel_with_their_samples(ring):
    ring.begin(0, 0)
    ring.write(counted(0, 1_000))
    ring.event(LATE)
    ring.write(counted(1_000, 1_500))
    ring.event(STEP, 10**12)
    ring.write(counted(1_500, 2_000))
    blocks = ring.read()
    assert [block.flags for block in blocks] == [frozenset(), {"late"}, {"clock_step"}]
    assert blocks[2].utc_ns == 10**12 and blocks[1].utc_ns == 1_000 * 50_000


def test_an_event_at_the_head_waits_for_its_sample(ring):
    ring.begin(0, 0)
    ring.write(counted(0, 800))
    ring.event(STEP, 10**12)
    (before,) = ring.read()
    ring.write(counted(800, 1_600))
    (after,) = ring.read()
    assert not before.flags and after.flags == {"clock_step"} and after.utc_ns == 10**12


def test_samples_overwritten_while_they_are_copied_are_lost_not_torn(ring, monkeypatch):
    ring.begin(0, 0)
    ring.write(counted(0, 14_000))
    take = Ring._overwritten
    calls = []

    def writer_comes_round(self):
        if calls:
            ring.write(counted(14_000, 16_000))
        calls.append(1)
        return take(self)

    monkeypatch.setattr(Ring, "_overwritten", writer_comes_round)
    (block,) = ring.read()
    assert block.lost == block.index == 1_000
    np.testing.assert_array_equal(index_of(block.codes), np.arange(1_000, 14_000))


def test_recent_samples_can_be_had_again_up_to_the_last_gap_or_clock_step(ring):
    ring.begin(0, 10**9)
    assert ring.recent(100) is None
    ring.write(counted(0, 1_000))
    ring.read()
    block = ring.recent(400)
    np.testing.assert_array_equal(index_of(block.codes), np.arange(600, 1_000))
    assert (block.index, block.utc_ns) == (600, 10**9 + 600 * 50_000)
    ring.event(GAP, 7)
    ring.write(counted(1_007, 1_107))
    ring.read()
    assert (ring.recent(400).index, len(ring.recent(400).codes)) == (1_007, 100)
    ring.event(STEP, 5 * 10**9)
    ring.write(counted(1_107, 1_157))
    ring.read()
    assert (ring.recent(400).index, ring.recent(400).utc_ns) == (1_107, 5 * 10**9)


@settings(max_examples=30)
@given(steps=st.lists(st.tuples(st.integers(0, 3_000), st.sampled_from([0, 0, 9])), min_size=1, max_size=20))
def test_recent_samples_are_those_that_were_written(steps):
    ring, fd = Ring.create(RingLayout(RATE, 2, 8_000))
    ring.begin(0, 10**9)
    index = 0
    for count, gap in steps:
        if gap:
            ring.event(GAP, gap)
            index += gap
        ring.write(counted(index, index + count))
        index += count
        ring.read()
        block = ring.recent(5_000)
        if block is not None:
            np.testing.assert_array_equal(index_of(block.codes), block.index + np.arange(len(block.codes)))
            assert len(block.codes) <= 5_000 and block.utc_ns == 10**9 + block.index * 50_000
    os.close(fd)
