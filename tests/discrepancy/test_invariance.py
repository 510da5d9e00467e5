"""A verdict depends neither on the calendar nor on names nor on the order of recordings."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import inverse_dynamics
from tests.builders import ROBOT, grey, recording
from tests.discrepancy.independent import COMMON, extra_power, lagged_mean, selected

DAY_S = 86_400.0


def beside_the_axis(scene, random):
    arms = Arm(ROBOT, Payload(2.0, (0.0, 0.15, 0.05))), Arm(ROBOT)
    loaded, bare = (inverse_dynamics(arm, scene.q, scene.qd, scene.qdd) for arm in arms)
    return extra_power(scene, loaded - bare)


@pytest.fixture(scope="module")
def model():
    return grey()


@pytest.fixture(scope="module")
def sides(model):
    before = [recording(model, k, rows=500, seed=1) for k in range(5)]
    after = [recording(model, k, beside_the_axis, rows=500, seed=2, start_s=1e9 + 5000) for k in range(5)]
    return before, after


def said(robot, before, after):
    only = COMMON | {"payload", "gravity_bias", "coulomb_friction", "copper_loss"}
    _, selection = selected(grey(), robot, after, before, only)
    effects = [(n.id, n.place.where, n.shape, n.finding.coefficients.tolist()) for n in selection.effects]
    return selection.verdict, effects


@pytest.mark.slow
def test_dates_names_and_order_change_nothing(robot, sides):
    before, after = sides
    verdict, effects = said(robot, before, after)
    assert verdict == "effects_found"
    assert [(name, where) for name, where, _, _ in effects] == [("payload", "flange, beside its axis")]
    mass, first, second = effects[0][3]
    assert mass == pytest.approx(2.0, rel=0.1) and np.hypot(first, second) == pytest.approx(0.3, rel=0.2)
    # all at once: a difference that one of the changes makes stays visible
    changed = [
        replace(s, recording=f"x{9 - k}", source=f"x{9 - k}", start_s=s.start_s + 1000 * DAY_S)
        for k, s in enumerate(after)
    ]
    set_clock = [[replace(s, start_s=s.start_s + 77.7) for s in side[::-1]] for side in (before, changed)]
    _same(said(robot, *set_clock), (verdict, effects))


def _same(now, then):
    assert now[0] == then[0]
    for (name, where, shape, sizes), (was, there, form, values) in zip(now[1], then[1], strict=True):
        assert (name, where) == (was, there) and shape == pytest.approx(form, rel=1e-3)
        assert sizes == pytest.approx(values, rel=1e-3)


@pytest.mark.parametrize("days", [21, 200])
def test_a_short_session_months_after_the_reference_is_judged(robot, model, days):
    before = [recording(model, k, rows=130, seed=1) for k in range(6)]
    after = [recording(model, k, rows=100, seed=2, start_s=1e9 + days * DAY_S) for k in range(6)]
    verdict, effects = said(robot, before, after)
    assert verdict in ("nothing_left", "not_identifiable") and effects == []


def test_a_spring_is_described_and_not_named(robot, model):
    def spring(scene, random):
        return lagged_mean(scene.power_per_torque[:, 2] * 30.0 * scene.q[:, 2])

    before = [recording(model, k, rows=500, seed=1) for k in range(7)]
    after = [recording(model, k, spring, rows=500, seed=2, start_s=1e9 + 5000) for k in range(7)]
    _, selection = selected(model, robot, after, before, COMMON | {"payload", "viscous_friction", "copper_loss"})
    assert selection.verdict == "unknown_structure", [(n.id, n.place.where) for n in selection.effects]
    assert selection.unknown.finding.candidate.label == "a torque that depends on the angle of joint 3"
    leading = selection.table[0]
    assert leading.id == "" and "joint 3" in leading.as_text()
