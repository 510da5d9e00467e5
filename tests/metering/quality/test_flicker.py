"""The flickermeter against the standard's test signals (simulated), and its filters against scipy's."""

from __future__ import annotations

import itertools
import tracemalloc

import numpy as np
import pytest
from scipy import signal

from acqd.conformance.flicker_tables import RECTANGULAR, SINUSOIDAL, carrier, rectangular, sinusoidal
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.quality.flicker import SETTLING_S, FlickerMeter, PinstStream
from acqd.metering.quality.linear_filter import LinearFilter, bilinear, butterworth
from acqd.metering.quality.severity import LongTerm, Severity, short_term

RATE = 4_000.0


def pinst(u, lamp, f):
    stream = PinstStream(1, RATE, f, lamp)
    chunk = stream.step * stream.thin
    return stream.feed(u[None, : len(u) // chunk * chunk])


@pytest.mark.parametrize("system", SINUSOIDAL, ids=str)
@pytest.mark.parametrize("hertz", [0.5, 1.5, 4.0, 8.8, 14.0, 20.0, 25.0])
def test_the_largest_pinst_of_a_sinusoidal_change_is_one(system, hertz):
    Pinst = pinst(sinusoidal(*system, hertz, SINUSOIDAL[system][hertz], RATE, 20.0), *system)
    assert Pinst[0, Pinst.shape[1] // 2 :].max() == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(("lamp", "f", "per_minute"), [("230V", 50, 110), ("230V", 50, 1620), ("120V", 60, 1620)])
def test_pst_of_a_rectangular_change_is_one(lamp, f, per_minute):
    u = rectangular(lamp, f, per_minute, RECTANGULAR[lamp, f][per_minute], RATE, 90.0)
    assert short_term(pinst(u, lamp, f)[:, -round(60 * RATE / 20) :])[0] == pytest.approx(1, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("lamp", "f"), RECTANGULAR, ids=str)
@pytest.mark.parametrize("per_minute", [1, 2, 7, 39, 110, 1620])
def test_pst_of_ten_minutes_is_one(lamp, f, per_minute):
    u = rectangular(lamp, f, per_minute, RECTANGULAR[lamp, f][per_minute], RATE, 720.0)
    assert short_term(pinst(u, lamp, f)[:, -round(600 * RATE / 20) :])[0] == pytest.approx(1, abs=0.05)


def meter_values(u, cuts, begin_ns, **how):
    meter = FlickerMeter(StreamFormat(RATE, (1.0, 1.0), 50.0, 64), **how)
    codes, values = np.repeat(u[:, None], 2, axis=1), []
    for a, b in cuts:
        values += meter.feed(SampleBlock(codes[a:b], a, begin_ns + round(a * 1e9 / RATE)))
    return values


def test_intervals_lie_on_the_clock_and_blocks_may_be_of_any_length():
    t = np.arange(round(1215 * RATE)) / RATE
    u = carrier("230V", 50, t) * (1 + 0.00361 * np.where(np.floor(t * 110 / 60) % 2, 1, -1))
    edges = np.unique(np.r_[0, np.random.default_rng(0).integers(0, len(u), 40), len(u)])
    first, second = meter_values(u, list(itertools.pairwise(edges)), 1_800_000_000_000_000_000 - 10**9)
    assert first.utc_ns == 1_800_000_000_000_000_000 and first.flags == {"gap"}  # the filters had to settle
    assert second.utc_ns == first.utc_ns + 600 * 10**9 and second.flags == set()
    assert second.value[0] == pytest.approx(1, abs=0.05)


def test_a_gap_is_flagged_and_leaves_no_spike():
    t = np.arange(round(615 * RATE)) / RATE
    u = carrier("230V", 50, t)
    half = len(u) // 2
    edges = [(k, k + 40_000) for k in range(0, half - 40_000, 40_000)]
    edges += [(k, min(k + 40_000, len(u))) for k in range(half, len(u), 40_000)]
    (value,) = meter_values(u, edges, 0, on_the_clock=False)
    assert value.flags == {"gap"} and value.utc_ns == SETTLING_S * 1e9
    assert value.value[0] < 0.05


def test_an_interruption_is_flagged_and_ends_with_the_mean_of_before():
    t = np.arange(round(60 * RATE)) / RATE
    u = carrier("230V", 50, t) * np.where((t > 15) & (t < 40), 0.0, 1.0)
    stream = PinstStream(1, RATE, 50, "230V")
    Pinst = stream.feed(u[None])[0]
    assert stream.away and np.isfinite(Pinst).all()
    assert Pinst[-1] < 0.1  # the normalisation has not followed into the dark


def test_plt_is_the_cubic_mean_of_twelve_whole_parts():
    hour2 = 7200 * 10**9
    longer, parts = LongTerm(), [0.5 + 0.1 * k for k in range(12)]
    given = [Severity(hour2 + k * 600 * 10**9, 600.0, np.array([value])) for k, value in enumerate(parts)]
    (long,) = [one for part in given if (one := longer.take(part)) is not None]
    assert long.utc_ns == hour2 and long.value[0] == pytest.approx(np.mean(np.array(parts) ** 3) ** (1 / 3))
    (partly,) = [one for part in given[3:] if (one := LongTerm().take(part)) is not None]
    assert np.isnan(partly.value[0]) and partly.flags == {"gap"}


def test_the_filters_are_those_of_scipy():
    rate, x = 2_000.0, np.random.default_rng(0).normal(size=(2, 3_001)) + 1
    mine = LinearFilter([bilinear([1.0, 0.0], [1.0, 2 * np.pi * 0.05], rate), *butterworth(6, 35.0, rate)], 2)
    pieces = [mine.feed(x[:, a:b]) for a, b in [(0, 77), (77, 1_000), (1_000, 1_001), (1_001, 3_001)]]
    high = signal.lfilter(*signal.butter(1, 0.05 / 1_000, "high"), x, axis=1)
    theirs = signal.sosfilt(signal.butter(6, 35 / 1_000, output="sos"), high, axis=1)
    assert np.concatenate(pieces, axis=1) == pytest.approx(theirs, abs=1e-8)
    mine.settle(np.ones(2))
    assert mine.feed(np.ones((2, 300))) == pytest.approx(0, abs=1e-9)


def test_a_whole_recording_in_one_block_is_filtered_in_pieces_that_change_nothing():
    form = StreamFormat(RATE, (0.0225, 0.000281))
    one = np.rint(14_000 * np.cos(2 * np.pi * 50 * np.arange(int(60 * RATE)) / RATE)).astype(np.int16)
    codes = np.tile(one[:, None], (11, 2))
    tracemalloc.start()
    (whole,) = FlickerMeter(form, on_the_clock=False).feed(SampleBlock(codes, 0, 0))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < codes.nbytes, "the block as double numbers is four times as large"
    cut = FlickerMeter(form, on_the_clock=False)
    (again,) = (
        each for k in range(0, len(codes), 40_000)
        for each in cut.feed(SampleBlock(codes[k : k + 40_000], k, round(k * 1e9 / RATE)))
    )  # fmt: skip
    np.testing.assert_allclose(whole.value, again.value, rtol=1e-9)
