"""Steps, leaps and slews of the computer's clock: the stream follows, and its time never goes back unannounced."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.plc.clock import ABSORBED_NS, STEP_NS, StepDetector


@pytest.mark.parametrize("step_s", [-3600.0, -1.0, 0.5, 86_400.0])
def test_clock_steps_are_seen_and_measured(step_s):
    detector = StepDetector()
    offset, found = 0, None
    for window in range(200):
        now = window * 40_000_000 + 2_000_000 + (window % 7) * 1_000_000
        step = int(step_s * 1e9) if window >= 100 else 0
        found = detector.check(now + step, now - 2_000_000 + offset)
        if found is not None:
            assert window >= 100
            offset += found
    assert abs(offset - step_s * 1e9) < STEP_NS


def test_lateness_is_not_mistaken_for_a_clock_step():
    detector = StepDetector()
    random = np.random.default_rng(0)
    for window in range(5_000):
        late = int(random.exponential(20e6)) + (400_000_000 if window % 50 == 0 else 0)
        assert detector.check(window * 40_000_000 + late, window * 40_000_000) is None


WINDOW_NS = 40_000_000


def follow(utc_of_window, windows):
    """Time that the stream gives to each window, and the windows in which it was moved."""
    detector, offset, times, moved = StepDetector(), 0, [], []
    for window in range(windows):
        due = window * WINDOW_NS
        step = detector.check(utc_of_window(window) + 1_000_000, due + offset)
        if step is not None:
            offset += step
            moved.append(window)
        times.append(due + offset)
    return np.array(times), moved


def test_a_leap_second_slows_the_stream_until_utc_has_caught_up():
    leap = 100  # the kernel repeats a second here
    times, moved = follow(lambda k: k * WINDOW_NS - (10**9 if k >= leap else 0), 300)
    assert (np.diff(times) >= WINDOW_NS // 2).all()
    assert moved[0] == leap and len(moved) <= 52
    assert abs(times[-1] - (299 * WINDOW_NS - 10**9)) < STEP_NS


@pytest.mark.parametrize("ppm", [500, -500])
def test_a_slewed_clock_is_followed_in_steps_of_a_tenth_of_a_second_at_most(ppm):
    times, moved = follow(lambda k: round(k * WINDOW_NS * (1 + ppm * 1e-6)), 50_000)
    assert (np.diff(times) > 0).all() and moved
    wrong = times - np.arange(50_000) * WINDOW_NS * (1 + ppm * 1e-6)
    assert np.abs(wrong).max() < 1.05 * STEP_NS + WINDOW_NS


@given(st.lists(st.tuples(st.integers(0, 400), st.floats(-9.9, 3600.0)), max_size=6))
def test_whatever_small_steps_back_and_large_steps_forward_come_time_only_rises(steps):
    def utc(window):
        return window * WINDOW_NS + round(sum(size * 1e9 for at, size in steps if window >= at))

    times, _ = follow(utc, 450)
    back = np.diff(times) < 0
    # Several steps back may add up to one that is not absorbed.
    if -sum(min(0.0, size) for _, size in steps) * 1e9 < ABSORBED_NS:
        assert not back.any()


def test_a_clock_that_was_wrong_by_an_hour_is_followed_at_once():
    times, moved = follow(lambda k: k * WINDOW_NS - (3600 * 10**9 if k >= 100 else 0), 200)
    assert moved == [100] and times[100] - times[99] < -3599e9
