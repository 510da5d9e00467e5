""""""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering import Meter, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.block import WIDE_CODE_MAX
from tests.mains import EN50160, make_mains
from tests.metering.streams import meter_all
from tests.sources.counted import RATE


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


@pytest.mark.parametrize("phases", [1, 3])
@pytest.mark.parametrize("f", [49.5, 49.87, 50.0, 50.4, 51.0, 59.5, 60.0, 60.5])
def test_synchronous_accuracy_on_hard_mains(f, phases):
    mains = make_mains(f, harmonics=EN50160, noise=0.001, dc=0.01, phases=phases)
    batch = meter_all(mains)
    good = slice(1, None)  # the first window of a stream is flagged "start"
    assert np.abs(batch.Vrms[:, good] / mains.Vrms - 1).max() < 0.0002
    assert np.abs(batch.Irms[:, good] / mains.Irms - 1).max() < 0.0002
    assert np.abs(batch.P[:, good] - mains.P).max() < 0.0004 * mains.Vrms * mains.Irms
    assert np.abs(batch.f[good] - f).max() < 0.010


def test_fixed_mode_is_the_textbook_sum_over_exactly_the_window():
    mains = make_mains(49.3, harmonics=EN50160, noise=0.001)
    batch = meter_all(mains, mode="fixed")
    for phase in range(3):
        u = mains.codes[:, 2 * phase].astype(float) * mains.scale[0]
        i = mains.codes[:, 2 * phase + 1].astype(float) * mains.scale[1]
        u, i = u[: 800 * len(batch)].reshape(-1, 800), i[: 800 * len(batch)].reshape(-1, 800)
        np.testing.assert_allclose(batch.Vrms[phase], np.sqrt((u * u).mean(axis=1)), rtol=1e-12)
        np.testing.assert_allclose(batch.P[phase], (u * i).mean(axis=1), rtol=1e-9)


@settings(max_examples=20)
@given(cuts=st.lists(st.integers(1, 39_999), max_size=12, unique=True))
def test_how_the_stream_is_cut_into_blocks_does_not_matter(cuts):
    mains = make_mains(49.7, seconds=2.0, harmonics={5: 0.05}, noise=0.001, phases=1)
    whole, cut = meter_all(mains), meter_all(mains, cuts=cuts)
    np.testing.assert_array_equal(whole.seq, cut.seq)
    np.testing.assert_array_equal(whole.utc_ns, cut.utc_ns)
    np.testing.assert_allclose(whole.f, cut.f, atol=1e-5)
    np.testing.assert_allclose(whole.Vrms, cut.Vrms, rtol=1e-6)
    np.testing.assert_array_equal(whole.W, cut.W)
    assert whole.flags == cut.flags


@pytest.mark.parametrize("rate", [2_000.0, 4_000.0, 5_760.0, 30_707.24, 44_100.0])
def test_rates_that_do_not_divide_the_window(rate):
    mains = make_mains(50.1, rate=rate, seconds=3.0, harmonics={3: 0.05, 5: 0.06})
    batch = meter_all(mains)
    assert np.abs(batch.Vrms[:, 1:] / mains.Vrms - 1).max() < 0.0002
    np.testing.assert_allclose(np.diff(batch.utc_ns), 0.04e9, atol=1e9 / rate)


def test_first_window_of_a_stream_is_flagged_and_still_right_below_50_hz():
    mains = make_mains(46.0, seconds=1)
    batch = meter_all(mains)
    assert "start" in batch.flags[0][0] and "start" not in batch.flags[0][1]
    assert abs(batch.Vrms[0, 0] / mains.Vrms - 1) < 0.002
    assert abs(batch.f[0] - 46.0) < 0.01


def test_a_stream_may_start_in_mid_window():
    mains = make_mains(50.0, seconds=1)
    meter = Meter(StreamFormat(20_000.0, mains.scale))
    batch = meter.feed(SampleBlock(mains.codes, 100_300, 5_000_000_000))
    assert batch.seq[0] == 125 and "start" in batch.flags[0][0] and "gap" not in batch.flags[0][1]
    assert batch.Vrms[0, 0] == pytest.approx(mains.Vrms, rel=1e-3)
    assert batch.utc_ns[1] == 5_000_000_000 + (126 * 800 - 100_300) * 50_000


def feed_with_gap(begin, end, **options):
    mains = make_mains(50.1, seconds=2)
    meter = Meter(StreamFormat(20_000.0, mains.scale), **options)
    first = meter.feed(SampleBlock(mains.codes[:begin], 0, 0))
    second = meter.feed(SampleBlock(mains.codes[end:], end, end * 50_000, lost=end - begin))
    return mains, WindowBatch.join([batch for batch in (first, second) if batch is not None])


@pytest.mark.parametrize("mode", ["synchronous", "fixed"])
@pytest.mark.parametrize(
    ("begin", "end"), [(8_200, 8_300), (8_000, 8_400), (8_400, 8_800), (8_100, 9_500), (8_050, 16_790)]
)
def test_a_gap_is_flagged_counted_and_never_interpolated(begin, end, mode):
    mains, batch = feed_with_gap(begin, end, mode=mode)
    flagged = {int(seq) for seq, flags in zip(batch.seq, batch.flags[0], strict=True) if "gap" in flags}
    torn = {begin // 800 if begin % 800 else end // 800, end // 800}
    assert flagged == torn
    clean = [k for k, seq in enumerate(batch.seq) if seq not in flagged and seq]
    np.testing.assert_allclose(batch.Vrms[0, clean], mains.Vrms, rtol=1e-3 if mode == "synchronous" else 0.02)
    np.testing.assert_array_equal(batch.utc_ns, batch.seq * 40_000_000)
    present = np.r_[0:begin, end : 800 * (int(batch.seq[-1]) + 1)]
    codes = mains.codes[present].astype(float)
    exact = (codes[:, 0] * codes[:, 1]).sum() * mains.scale[0] * mains.scale[1] / 20_000 / 3.6e6
    assert batch.W[0, -1] == pytest.approx(exact, rel=1e-12)


def test_windows_lost_whole_have_no_row_and_numbers_go_on():
    _, batch = feed_with_gap(8_000, 16_000)
    assert batch.seq.tolist() == [*range(10), *range(20, 50)]
    assert [k for k, flags in zip(batch.seq, batch.flags[0], strict=True) if "gap" in flags] == [20]


def test_interruption_gives_no_mains_and_no_frequency():
    mains = make_mains(50.2, seconds=2)
    mains.codes[16_000:24_000, 0::2] = np.random.default_rng(0).integers(-3, 4, (8_000, 3))
    mains.codes[16_000:24_000, 1::2] = 0
    batch = meter_all(mains)
    dead = range(21, 30)
    for k in dead:
        assert "no_mains" in batch.flags[0][k] and np.isnan(batch.f[k]) and batch.Vrms[0, k] < 1
    alive = [*range(1, 19), *range(33, 50)]
    assert not any("no_mains" in batch.flags[0][k] for k in alive)
    assert np.abs(batch.f[alive] - 50.2).max() < 0.01


def test_mains_that_return_are_seen_at_once_however_the_stream_is_cut():
    mains = make_mains(51.7, seconds=2, phases=1)
    mains.codes[:24_000] = 0
    whole, cut = meter_all(mains), meter_all(mains, cuts=range(800, 40_000, 800))
    np.testing.assert_allclose(whole.f[32:], 51.7, atol=0.01)
    np.testing.assert_allclose(cut.f, whole.f, atol=1e-5)


@settings(max_examples=40)
@given(begin=st.integers(1_000, 12_000), length=st.integers(100, 9_000), f=st.floats(45.5, 64.5))
def test_no_interruption_gives_nonsense(begin, length, f):
    mains = make_mains(f, seconds=1, phases=1)
    mains.codes[begin : begin + length] = 0
    batch = meter_all(mains)
    assert (batch.Vrms >= 0).all() and (batch.Vrms < 1.2 * mains.Vrms).all() and (batch.Irms >= 0).all()
    known = batch.f[~np.isnan(batch.f)]
    assert ((known > 44.4) & (known < 65.6)).all()


def test_one_dead_phase_is_flagged_alone():
    mains = make_mains(50.0, seconds=1)
    mains.codes[:, 2] = 0
    batch = meter_all(mains)
    assert all("no_mains" in flags for flags in batch.flags[1])
    assert not any("no_mains" in flags for flags in batch.flags[0])
    assert not np.isnan(batch.f).any()


def test_over_range_codes_are_flagged_per_phase():
    mains = make_mains(50.0, seconds=1)
    mains.codes[4_010, 3] = 32_767
    mains.codes[8_010, 0] = -32_768
    batch = meter_all(mains)
    hits = {(p, k) for p in range(3) for k in range(len(batch)) if "overrange" in batch.flags[p][k]}
    assert hits == {(1, 5), (0, 10)}


def test_a_clock_step_moves_time_only_from_there_on():
    mains = make_mains(50.0, seconds=1)
    meter = Meter(StreamFormat(20_000.0, mains.scale))
    first = meter.feed(SampleBlock(mains.codes[:8_000], 0, 0))
    step = SampleBlock(mains.codes[8_000:], 8_000, 3_400_000_000, flags=frozenset({"clock_step"}))
    second = meter.feed(step)
    assert first.utc_ns[-1] == 9 * 40_000_000
    assert second.utc_ns.tolist() == [3_400_000_000 + k * 40_000_000 for k in range(15)]
    flagged = [int(s) for s, f in zip(second.seq, second.flags[0], strict=True) if "clock_step" in f]
    assert flagged == [10]


@pytest.mark.parametrize(
    ("rate", "scale", "complaint"),
    [(100.0, (0.02, 0.0003), "200 Hz"), (20_000.0, (0.02,), "channels"), (20_000.0, (1e6, 1e-3), "U1"),
     (20_000.0, (float("nan"), 1e-3), "U1"), (20_000.0, (0.02, 0.0), "I1")],
)  # fmt: skip
def test_impossible_formats_are_refused(rate, scale, complaint):
    with pytest.raises(ValueError, match=complaint):
        StreamFormat(rate, scale)
