"""The delay between motion and power."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.residual.delay import corrected, find_delay
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
