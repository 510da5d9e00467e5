"""Intervals without gaps, in interruptions, at ten-minute ticks, over lost samples."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.quality.meter import QualityMeter
from tests.metering.quality.waves import T0, metered, of_kind, three_phases

RATE = 4_000.0
TICK = 1_700_000_400 * 10**9


def wave(seconds, f=50.0, gain=None):
    t = np.arange(int(seconds * RATE)) / RATE
    x = three_phases(2 * np.pi * f * t)
    return x if gain is None else x * gain(t)[:, None]


def ends(values):
    return [(one.utc_ns, one.utc_ns + round(one.duration * 1e9)) for one in values]


def assert_gapless(values):
    for (_, end), (begin, _) in itertools.pairwise(ends(values)):
        assert begin == pytest.approx(end, abs=100)


def test_intervals_go_on_through_an_interruption():
    values = of_kind(metered(wave(4, 50.5, lambda t: np.where((t > 1.01) & (t < 2.4), 0.0, 1.0)), RATE, block=160))
    assert_gapless(values)
    dark = [one for one in values if "interruption" in one.flags]
    assert len(dark) in (7, 8, 9) and all(np.isnan(one.f) and "dip" in one.flags for one in dark)
    assert all(abs(one.duration - 10 / 50.5) < 1e-5 for one in values)
    assert values[-1].f == pytest.approx(50.5, abs=1e-3) and not values[-1].flags


def test_a_dip_of_half_a_cycle_and_a_swell_are_flagged():
    def disturbed(t):
        return np.where((t > 0.5) & (t < 0.511), 0.5, np.where((t > 1.5) & (t < 1.6), 1.2, 1.0))

    values = of_kind(metered(wave(2.4, gain=disturbed), RATE))
    assert [sorted(one.flags - {"transient"}) for one in values if one.flags - {"transient"}] == [["dip"], ["swell"]]


def test_at_a_ten_minute_tick_intervals_restart_and_overlap():
    values = metered(wave(9, 49.7), RATE, t0=TICK - 4_080_000_000, block=160)
    short = of_kind(values)
    at_tick = [one for one in short if abs(one.utc_ns - TICK) < 1_000]
    assert len(at_tick) == 1
    before = short[: short.index(at_tick[0])]
    assert_gapless(before)
    assert before[-1].utc_ns < TICK < ends(before)[-1][1]
    assert_gapless(short[len(before) :])
    cycles = of_kind(values, "150/180")
    assert [one.intervals for one in cycles] == [15, 15, 15]
    assert abs(cycles[2].utc_ns - TICK) < 1_000 or abs(cycles[1].utc_ns - TICK) < 1_000
    trailing = next(one for one in cycles if one.utc_ns < TICK < ends([one])[0][1])
    assert trailing.duration == pytest.approx(150 / 49.7, rel=1e-4)
    [ten] = of_kind(values, "10min")
    assert ten.utc_ns == before[0].utc_ns and ten.intervals == len(before) and "gap" in ten.flags


def test_a_clock_that_is_set_to_another_tick_and_150_cycles_that_end_with_one():
    """The first tick is in the fifteenth interval; the clock is set so that another one is in the third after that."""
    x = wave(8)
    meter = QualityMeter(StreamFormat(RATE, (1.0,) * 6, bits=64))
    begin, step, values = TICK - 2_900_000_000, 600 * 10**9, []
    for first in range(0, len(x), 160):
        moved = first >= 13_600  # 0.5 s after the first tick
        utc = begin + first * 250_000 + (step - 1_000_000_000 if moved else 0)
        flags = frozenset({"clock_step"} if first == 13_600 else ())
        values += meter.feed(SampleBlock(x[first : first + 160], first, utc, flags=flags))
    cycles = of_kind(values, "150/180")
    assert [one.intervals for one in cycles] == [15, 15, 15]
    assert cycles[0].utc_ns < TICK and "clock_step" in cycles[1].flags
    assert len(of_kind(values, "10min")) == 2
    assert any(abs(one.utc_ns - TICK - step) < 1_000 for one in of_kind(values))


def test_a_tick_that_an_interval_ends_at_exactly_restarts_nothing_twice():
    start = metered(wave(0.5), RATE)[0].utc_ns - T0
    values = of_kind(metered(wave(3), RATE, t0=TICK - 1_000_000_000 - start))
    assert_gapless(values)
    assert len(values) == 14


def test_lost_samples_begin_another_chain_that_is_flagged():
    values = metered(wave(6), RATE, block=160, lost=(8_000, 9_600))
    short = of_kind(values)
    assert [sorted(one.flags) for one in short if one.flags] == [["gap"]]
    [flagged] = [one for one in short if one.flags]
    assert flagged.utc_ns > T0 + 2.4e9
    cycles = of_kind(values, "150/180")
    assert [("gap" in one.flags, one.intervals) for one in cycles] == [(True, 9), (True, 15)]


def test_flags_of_blocks_reach_the_intervals_that_they_touch():
    values = of_kind(metered(wave(2), RATE, block=800, flags={3_200: {"late", "simulated"}}))
    flagged = [k for k, one in enumerate(values) if one.flags]
    assert flagged == [3, 4] and values[3].flags == {"late", "simulated"}


def test_an_end_stop_is_flagged_for_its_phase():
    codes = np.rint(wave(1)[:, :4] / 0.02).astype(np.int16)
    codes[2_000, 2] = 32_767
    meter = QualityMeter(StreamFormat(RATE, (0.02, 0.0003) * 2))
    values = of_kind(list(meter.feed(SampleBlock(codes, 0, T0))))
    assert [[sorted(named) for named in one.phase_flags] for one in values if any(one.phase_flags)] == [
        [[], ["overrange"]]
    ]


@settings(max_examples=15)
@given(st.lists(st.integers(1, 5_999), max_size=8, unique=True), st.integers(0, 2))
def test_blocks_may_be_cut_anywhere(cuts, phases):
    x = wave(1.5, 50.3)[:, : 2 * (phases + 1)]
    whole = metered(x, RATE, block=len(x))
    meter = QualityMeter(StreamFormat(RATE, (1.0,) * x.shape[1], bits=64))
    pieces = []
    for first, after in itertools.pairwise([0, *sorted(cuts), len(x)]):
        pieces += meter.feed(SampleBlock(x[first:after], first, T0 + first * 250_000))
    assert [one.utc_ns for one in pieces] == pytest.approx([one.utc_ns for one in whole], abs=1_000)
    for one, other in zip(pieces, whole, strict=True):
        assert one.phase["P"] == pytest.approx(other.phase["P"], rel=1e-6)


def test_an_empty_stream_and_one_that_is_too_short_give_nothing():
    meter = QualityMeter(StreamFormat(RATE, (1.0, 1.0), bits=64))
    assert list(meter.feed(SampleBlock(np.empty((0, 2)), 0, T0))) == []
    assert metered(wave(0.15), RATE) == []


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_samples_that_are_no_numbers_give_no_numbers(value):
    x = wave(2)
    x[3_000, 0] = value
    values = of_kind(metered(x, RATE))
    assert len(values) >= 8
    assert values[0].f == pytest.approx(50) and values[-1].f == pytest.approx(50)
