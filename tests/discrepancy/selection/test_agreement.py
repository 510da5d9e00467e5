"""Sessions that ask for different parameters of one effect are named."""

from dataclasses import replace

import pytest

from acqd.robot import load_description
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import inverse_dynamics
from tests.builders import recording
from tests.discrepancy.independent import COMMON, extra_power, selected


def body(aside_m):
    """Power of 4 kg at the flange, beside its axis."""

    def add(scene, random):
        arm = load_description("ur10e")
        motion = scene.q, scene.qd, scene.qdd
        more = inverse_dynamics(Arm(arm, Payload(4.0, (aside_m, 0, 0.05))), *motion)
        return extra_power(scene, more - inverse_dynamics(Arm(arm), *motion))

    return add


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_a_body_that_was_turned_round_between_two_logs_is_said(turned, model, robot):
    reference = [recording(model, k, rows=500, seed=1) for k in range(6)]
    question = []
    for log, aside_m in (("first", 0.3), ("second", -0.3 if turned else 0.3)):
        for k in range(4):
            piece = recording(model, k, body(aside_m), seed=2 if log == "first" else 3, start_s=1e9 + 5000)
            question.append(replace(piece, recording=f"{log}_p{k:03d}"))
    selection = selected(model, robot, question, reference, COMMON)[1]
    (named,) = [each for each in selection.effects if each.id == "payload"]
    assert set(named.disagreeing) == ({"first", "second"} if turned else set())
    assert [each.id for each in selection.effects] == ["payload"]
