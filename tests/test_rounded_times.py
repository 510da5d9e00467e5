"""Times with too few digits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.rounded_times import rebuilt_times, shared_stamps


def stamps(t, width, cut):
    return np.round((np.floor(t / width + 1e-9) if cut else np.round(t / width)) * width, 6)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from([0.1, 1.0]), st.booleans(), st.floats(0.005, 0.02), st.floats(0, 3))
def test_rows_of_a_regular_rate_are_within_the_stated_error(width, cut, row_s, start):
    true = 1000 + start + row_s * np.arange(4000)
    true[2000:] += 37.0  # the logger paused
    written = stamps(true, width, cut)
    shared = shared_stamps(written, np.ones(len(true) - 1, bool))
    rebuilt = rebuilt_times(written, shared)
    assert rebuilt is not None and rebuilt.row_s == pytest.approx(row_s, rel=0.01)
    assert np.abs(rebuilt.time - true).max() < rebuilt.error_s + 3.5 * row_s
    assert (np.diff(rebuilt.time) > 0).all()
    assert "write times with three decimals" in rebuilt.sentence()


def test_five_significant_digits_get_coarser_as_the_recording_goes_on():
    true = 0.01 + 0.01 * np.arange(60_000)
    written = np.array([float(f"{t:.4g}") for t in true])
    rebuilt = rebuilt_times(written, shared_stamps(written, np.ones(len(true) - 1, bool)))
    assert rebuilt is not None
    assert np.abs(rebuilt.time - true).max() < rebuilt.error_s + 0.02


def test_rows_of_an_irregular_rate_are_not_invented():
    true = np.cumsum(np.random.default_rng(0).exponential(0.01, 5000))
    written = stamps(true, 0.1, cut=True)
    assert rebuilt_times(written, shared_stamps(written, np.ones(len(true) - 1, bool))) is None


def test_rows_that_were_written_twice_share_no_stamp():
    written = np.repeat(np.arange(1000) * 0.01, 2)
    assert shared_stamps(written, np.tile([False, True], 1000)[:-1]) == 0


@pytest.mark.parametrize("width", [0.1, 1.0])
@pytest.mark.parametrize("cut", [False, True])
def test_a_rate_that_drifts_bends_the_line(width, cut):
    row_s = 0.0105 + 0.0001 * np.sign(np.sin(np.arange(4000) / 600)) + np.random.default_rng(1).normal(0, 8e-4, 4000)
    true = 1000.003 + np.cumsum(row_s)
    written = stamps(true, width, cut)
    rebuilt = rebuilt_times(written, shared_stamps(written, np.ones(len(true) - 1, bool)))
    assert rebuilt is not None
    off = rebuilt.time - true
    assert np.abs(off - off.mean()).max() < 0.02
    assert abs(off.mean()) < rebuilt.error_s + 0.002


@pytest.mark.parametrize("phase", [0.0, 0.4, 0.9])
def test_rows_at_the_same_places_of_each_stamp_leave_half_a_row_in_doubt(phase):
    true = 1000 + 0.01 * (np.arange(3000) + phase)
    written = stamps(true, 0.1, cut=True)
    rebuilt = rebuilt_times(written, shared_stamps(written, np.ones(len(true) - 1, bool)))
    assert rebuilt is not None and rebuilt.error_s == pytest.approx(0.03, abs=5e-4)
    assert np.abs(rebuilt.time - true).max() < rebuilt.error_s


@pytest.mark.parametrize("cut", [False, True])
def test_more_digits_at_the_beginning_tell_whether_the_later_ones_were_cut_off(cut):
    true = 5.003 + 0.0107 * np.arange(4000)
    written = np.where(true < 10, stamps(true, 0.001, cut), stamps(true, 0.1, cut))
    rebuilt = rebuilt_times(written, shared_stamps(written, np.ones(len(true) - 1, bool)))
    assert rebuilt is not None and rebuilt.rounded is (not cut)
    assert np.abs(rebuilt.time - true).max() < 0.015 > rebuilt.error_s


@pytest.mark.parametrize("late", [False, True])
def test_stamps_of_packets_or_of_a_slow_clock_may_be_before_or_after_their_rows(late):
    true = 1000.003 + 0.01 * np.arange(3000)
    written = np.round((np.ceil(true / 0.08) if late else np.floor(true / 0.08)) * 0.08, 6)
    rebuilt = rebuilt_times(written, shared_stamps(written, np.ones(len(true) - 1, bool)))
    assert rebuilt is not None and not rebuilt.by_digits
    assert np.abs(rebuilt.time - true).max() < rebuilt.error_s < 0.05
    assert "of a slow clock or of rows in packets" in rebuilt.sentence()
