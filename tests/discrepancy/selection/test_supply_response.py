"""A law of the supply that both sides have acts on the power of new effects too."""

import numpy as np
import pytest

from tests.builders import recording
from tests.discrepancy.independent import COMMON, extra_at_drives, lagged_mean, payload_torque, selected

ONLY = COMMON | {"payload", "regeneration_clipping"}


@pytest.mark.slow
def test_a_chopper_before_and_after_is_no_second_change(model, robot):
    def chopped(scene, more):
        drives = scene.drives + more
        return lagged_mean(more + np.maximum(-drives - 5.0, 0))

    def before(scene, random):
        return chopped(scene, np.zeros(len(scene.q)))

    def after(scene, random):
        return chopped(scene, extra_at_drives(scene, payload_torque(scene, 6.0)))

    reference = [recording(model, k, before, seed=1) for k in range(7)]
    in_question = [recording(model, k, after, seed=2, start_s=1e9 + 5000) for k in range(7)]
    _, selection = selected(model, robot, in_question, reference, ONLY)
    assert [named.id for named in selection.effects] == ["payload"]


@pytest.mark.slow
def test_a_chopper_that_is_new_is_named_beside_a_payload(model, robot):
    def after(scene, random):
        more = extra_at_drives(scene, payload_torque(scene, 2.0))
        return lagged_mean(more + np.maximum(-scene.drives - more, 0))

    reference = [recording(model, k, seed=1) for k in range(7)]
    in_question = [recording(model, k, after, seed=2, start_s=1e9 + 5000) for k in range(7)]
    _, selection = selected(model, robot, in_question, reference, ONLY)
    assert {named.id for named in selection.effects} == {"payload", "regeneration_clipping"}
