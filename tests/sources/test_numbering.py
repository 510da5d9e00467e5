"""Sample numbers, queue, phase lock and back-off: the pure parts of every device source."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.block import WIDE_CODE_MAX
from acqd.sources.backoff import Backoff
from acqd.sources.ethercat.lock import PhaseLock
from acqd.sources.numbering import SampleNumbering
from acqd.sources.queue import BlockQueue
from tests.conftest import make_mains

RATE = 20_000.0
FORM = StreamFormat(RATE, (0.02, 0.0003))


def counted(first: int, count: int) -> np.ndarray:
    """Samples that tell their device number."""
    number = np.arange(first, first + count)
    return np.column_stack((number % 30_000, number // 30_000)).astype(np.int16)


@settings(max_examples=200, deadline=None)
@given(
    steps=st.lists(st.tuples(st.integers(-60, 400), st.integers(1, 50)), min_size=1, max_size=40),
    drift=st.floats(-100e-6, 100e-6),
)
def test_any_order_of_gaps_overlaps_and_duplicates_gives_each_sample_once_at_one_offset(steps, drift):
    numbering = SampleNumbering(RATE)
    numbering.open(10**18, 0)
    counter, taken, lost = 5_000, 0, 0
    seen: list[int] = []
    for jump, count in steps:
        counter = max(5_000, counter + jump)
        utc = 10**18 + round((counter - 5_000) * 1e9 / RATE * (1 + drift))
        block = numbering.place(counted(counter, count), counter, utc)
        if block is not None:
            device = block.codes[:, 0].astype(int) + 30_000 * block.codes[:, 1].astype(int)
            if not seen:
                offset = int(device[0]) - block.index
            np.testing.assert_array_equal(device - offset, block.index + np.arange(len(device)))
            lost += block.lost
            seen += device.tolist()
        counter += count
        taken += count
    assert seen == sorted(set(seen))
    assert lost == numbering.lost == seen[-1] - seen[0] + 1 - len(seen)


@pytest.mark.parametrize("minutes", [0.01, 1.0, 24 * 60.0])
def test_an_outage_is_counted_exactly_although_the_clocks_drift_apart(minutes):
    numbering = SampleNumbering(RATE)
    numbering.open(0, 0)
    numbering.place(counted(0, 20), 0, 0)
    away = round(minutes * 60 * RATE)
    block = numbering.place(counted(away, 20), away, round(away * 1e9 / RATE * (1 + 100e-6)))
    assert block.index == away and block.lost == away - 20


@pytest.mark.parametrize("counter", [3, 10**9, 2**40])
def test_a_counter_that_contradicts_the_elapsed_time_is_placed_by_time(counter):
    numbering = SampleNumbering(RATE)
    numbering.open(0, 0)
    numbering.place(counted(500_000, 20), 500_000, 0)
    block = numbering.place(counted(0, 20), counter, 3_000_000_000)
    assert block.index == pytest.approx(60_000, abs=20)
    after = numbering.place(counted(0, 20), counter + 20, 3_001_000_000)
    assert after.index == block.index + 20 and after.lost == 0


@settings(max_examples=100, deadline=None)
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


def test_the_phase_lock_settles_at_its_target_although_the_clocks_differ_by_100_ppm():
    lock, period = PhaseLock(1_000_000), 1_000_000
    wake, phases = 123_456.0, []
    for _ in range(4_000):
        wake += period * (1 + 100e-6) + lock.correction_ns(round(wake), 0)
        phases.append(wake % period)
    assert all(abs(phase - 500_000) < 2_000 for phase in phases[-500:])


def test_the_pauses_of_the_back_off_grow_and_stay_bounded():
    backoff, now, tries = Backoff(500, 8_000), 0, []
    while now < 200_000:
        if backoff.due(now):
            tries.append(now)
        now += 10
    pauses = np.diff(tries)
    assert pauses[0] <= 510 and max(pauses) <= 8_010 and min(pauses[6:]) >= 5_990
    backoff.reset()
    assert backoff.due(now)


def test_wide_codes_are_metered_like_narrow_ones():
    mains = make_mains(50.0, seconds=1.0)
    narrow = Meter(StreamFormat(RATE, mains.scale)).feed(SampleBlock(mains.codes, 0, 0))
    fine = StreamFormat(RATE, tuple(scale / 1_000 for scale in mains.scale), bits=32)
    wide = Meter(fine).feed(SampleBlock(mains.codes.astype(np.int32) * 1_000, 0, 0))
    for name in ("Vrms", "Irms", "P", "f", "imported"):
        np.testing.assert_allclose(getattr(wide, name), getattr(narrow, name), rtol=1e-12)
    codes = mains.codes.astype(np.int32)
    codes[10_000, 1] = WIDE_CODE_MAX
    batch = Meter(StreamFormat(RATE, (1e-3, 1e-3) * 3, bits=32)).feed(SampleBlock(codes, 0, 0))
    assert [k for k, flags in enumerate(batch.flags[0]) if "overrange" in flags] == [12]
    assert not any("overrange" in flags for flags in batch.flags[1])
