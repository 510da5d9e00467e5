"""Unknown structures in faster motion than the reference."""

import pytest

from acqd.discrepancy.selection.beyond_reference import only_beyond_reference
from tests.builders import recording
from tests.discrepancy.independent import COMMON, column, extra_power, selected


def at_high_speed(scene, random):
    """A friction of joint 2 that the model lacks above 0.6 rad/s, before and after."""
    return extra_power(scene, column(scene, 1, 60.0 * (scene.qd[:, 1].clip(0.6) + scene.qd[:, 1].clip(None, -0.6))))


def spring(scene, random):
    return extra_power(scene, column(scene, 1, 25.0 * (scene.q[:, 1] + 1.2)))


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "only_beyond"), [(at_high_speed, True), (spring, False)])
def test_what_shows_in_faster_motion_only_is_no_verdict(structure, only_beyond, model, robot):
    before = [recording(model, k, at_high_speed, rows=600, seed=1, slower=6.0) for k in range(6)]
    after = [recording(model, k, structure, rows=600, seed=2, start_s=1e9 + 5000) for k in range(6)]
    _, selection = selected(model, robot, after, before, COMMON - {"payload"})
    unknown = selection.unknown
    assert unknown is not None, [row.as_text() for row in selection.table]
    assert only_beyond_reference(selection.rows, unknown.gate.open, unknown.finding, unknown.margin) is only_beyond
