"""The newest window of samples, and times in classes."""

from __future__ import annotations

import numpy as np

from acqd.metering import SampleBlock, StreamFormat
from acqd.plc.distribution import Durations, of_microseconds, together
from acqd.plc.recent import RecentSamples
from tests.plc.counting import RATE, counted, index_of

FORM = StreamFormat(RATE, (0.02, 0.0003))
T0 = 10**18


def block(start, stop, flags=frozenset()):
    return SampleBlock(counted(start, stop), start, T0 + start * 50_000, flags=flags)


def test_the_window_is_the_newest_whole_one_of_the_grid_however_the_blocks_are_cut():
    random = np.random.default_rng(1)
    recent, at = RecentSamples(FORM, 0.04), 0
    assert recent.window() is None
    for size in random.integers(1, 1500, 200).tolist():
        recent.add(block(at, at + size))
        at += size
        window = recent.window()
        if at < 800:
            assert window is None
            continue
        assert window.seq == at // 800 - 1 and window.utc_ns == T0 + 800 * window.seq * 50_000
        np.testing.assert_array_equal(index_of(window.codes), 800 * window.seq + np.arange(800))
    assert sum(len(each.codes) for each in recent._blocks) < 2401 + 2 * 1500


def test_after_a_gap_there_is_no_window_until_one_is_whole():
    recent = RecentSamples(FORM, 0.04)
    recent.add(block(0, 1000, frozenset({"simulated"})))
    assert recent.window().flags == {"simulated"}
    recent.add(block(1100, 2000))
    assert recent.window() is None
    recent.add(block(2000, 2500))
    assert recent.window().seq == 2 and not recent.window().flags


def test_times_are_counted_in_the_same_classes_both_ways():
    times_us = [0.5, 1, 1.5, 40, 40, 700, 70_000]
    durations = Durations()
    for each in times_us:
        durations.add(int(each * 1000))
    kept = durations.distribution()
    assert sum(kept.counts) == len(times_us) and kept.sum_us == sum(times_us)
    assert kept.counts[0] == 2 and kept.counts[kept.upper_us.index(50)] == 2 and kept.counts[-1] == 1
    twice = together([kept, None, kept])
    assert twice.counts == tuple(2 * count for count in kept.counts) and together([None]) is None
    histogram = np.zeros(2000, dtype=np.int64)
    histogram[[0, 1, 40, 1999]] = 3, 1, 2, 7
    coarse = of_microseconds(histogram, 1.0)
    assert coarse.counts[0] == 3 and coarse.counts[1] == 1 and coarse.counts[coarse.upper_us.index(50)] == 2
    assert coarse.counts[-1] == 7 and sum(coarse.counts) == 13
