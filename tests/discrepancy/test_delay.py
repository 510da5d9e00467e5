"""The delay between motion and power."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from acqd.discrepancy.delay import Delay, beyond_reference, corrected, delay_of, find_delay
from acqd.discrepancy.repair.terms import clock_term
from acqd.models.effects.scene import scene_of
from tests.builders import STEP, recording


def test_a_delay_is_seen_before_anything_else(model):
    segments = [recording(model, k, seed=3) for k in range(6)]
    late = [replace(s, P=np.interp(np.arange(len(s.P)) - 2.5, np.arange(len(s.P)), s.P)) for s in segments]
    scenes = [scene_of(model, s.q, s.signals, s.start_s, s.channels) for s in segments]
    assert find_delay(scenes, segments) is None
    delay = find_delay(scenes, late)
    assert delay is not None and not delay.drifts
    assert delay.offset_s == pytest.approx(0.1, abs=0.01)
    back = corrected(late[0], delay, STEP).P
    assert np.abs(back - segments[0].P)[20:-20].mean() < 0.5 * np.abs(late[0].P - segments[0].P)[20:-20].mean()


def test_a_delay_counts_from_that_of_unchanged_recordings(model):
    """A model whose lag is 3 ms short finds 3 ms in every recording: they are no part of a clock's offset."""

    def late_by(segments, seconds):
        rows = np.arange(len(segments[0].P))
        return [replace(s, P=np.interp(rows - seconds / STEP, rows, s.P)) for s in segments]

    segments = [recording(model, k, seed=3) for k in range(6)]
    scenes = [scene_of(model, s.q, s.signals, s.start_s, s.channels) for s in segments]
    delay = find_delay(scenes, late_by(segments, 0.063))
    assert delay is not None
    beyond = beyond_reference(delay, scenes, late_by(segments, 0.013))
    assert beyond.offset_s == pytest.approx(0.05, abs=0.003) and beyond.offset_error_s >= delay.offset_error_s
    assert np.median([each for _, each in beyond.single]) == pytest.approx(beyond.offset_s)
    assert beyond_reference(delay, scenes[:2], segments[:2]) == delay


@pytest.mark.parametrize(("ppm", "drifting"), [(0.0, 0.15), (300.0, 0.9)])
def test_confidence_in_a_clock_knows_an_offset_from_a_drift(ppm, drifting):
    random = np.random.default_rng(5)
    t = 150.0 * np.arange(8)
    delays = 0.05 + 1e-6 * ppm * t + random.normal(0, 0.001, len(t))
    rate = 1e-6 * ppm
    single = list(zip(t.tolist(), delays.tolist(), strict=True))
    term = clock_term(Delay(0.05, rate, 0.0, 0.001, 1e-6, single))
    said = term.confidence if ppm else 1 - term.confidence
    assert said > drifting if ppm else said < drifting


def test_three_recordings_do_not_prove_a_drift():
    """A line passes through two of three recordings: what the third is off by is the scatter of all."""
    single = [(0.0, 0.077), (72.0, 0.064), (144.0, 0.085)]
    term = clock_term(Delay(0.077, 0.0, 0.0, 0.006, 0.0, single))
    assert term.term.id == "clock_offset" and term.confidence > 0.4


@settings(max_examples=25, deadline=None)
@given(late_s=st.floats(-0.03, 0.03), seed=st.integers(0, 1000))
def test_delays_below_the_step_of_the_search_are_found_and_explain_what_they_explain(late_s, seed):
    random = np.random.default_rng(seed)
    t = STEP * np.arange(1500)
    rough = np.cumsum(random.normal(0, 4, len(t)))
    smooth = CubicSpline(t, 60 + gaussian_filter1d(rough - rough.mean(), 6))
    P = smooth(t - late_s) + random.normal(0, 0.05, len(t))
    found, gain, _ = delay_of(smooth(t), P, STEP)
    assert found == pytest.approx(late_s, abs=0.001)
    if abs(late_s) > 0.004:
        assert gain > 0.15
