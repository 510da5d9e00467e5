"""Scenes that are kept, and those that are made again."""

import numpy as np

from acqd.discrepancy.regression.scenes import Scenes
from tests.builders import recording


def test_a_scene_that_is_no_longer_kept_is_made_again_with_what_effects_remember(model):
    scenes = Scenes(model, [(recording(model, k, rows=60), k == 1) for k in range(2)])
    scenes.remember(1, {"origin_s": 5.0})
    kept = scenes[1]
    assert scenes[1] is kept
    scenes.drop_kept()
    again = scenes[1]
    assert again is not kept and scenes[1] is not again
    np.testing.assert_array_equal(again.tau, kept.tau)
    assert again.memory == {"origin_s": 5.0}
