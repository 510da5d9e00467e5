"""The delay between motion and power."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from acqd.discrepancy.residual.delay import corrected, delay_of, find_delay
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
