"""Sample numbers across gaps, duplicates and outages."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.sources.numbering import SampleNumbering
from tests.sources.counted import RATE, counted


@settings(max_examples=200)
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
