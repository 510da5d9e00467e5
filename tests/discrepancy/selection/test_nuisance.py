"""Small differences of two sides that are no effects."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.regression.setup import Question, set_up
from acqd.discrepancy.selection.forward_selection import Limits, trace
from acqd.discrepancy.selection.nuisance import level_difference, with_small_differences
from tests.builders import grey, recording
from tests.discrepancy.independent import COMMON, column, extra_power

MINUTES, DAYS = 30.0, 86400.0


def set_up_with(robot, level_W, apart_s):
    """Recordings with a constant load, and a reference whose recordings begin `apart_s` after each other."""
    model = grey()
    reference = [recording(model, k, seed=1, rows=500, start_s=1e9 + apart_s * k) for k in range(5)]
    new = [recording(model, k, seed=2, rows=500, start_s=1e9 + 5000) for k in range(4)]
    new = [replace(each, P=each.P + level_W) for each in new]
    only = frozenset(COMMON | {"supply_efficiency"})
    return set_up(Question(model, robot, new, reference, only, frozenset()), lambda _: None)


@pytest.mark.parametrize(
    ("level_share", "apart_s", "free"), [(0.01, MINUTES, True), (0.04, MINUTES, False), (0.01, DAYS, False)]
)
def test_a_small_level_is_free_beside_a_reference_of_minutes_only(robot, level_share, apart_s, free):
    level_W = level_share * set_up_with(robot, 0.0, apart_s).design.columns.dynamic_range
    found_W = level_difference(with_small_differences(set_up_with(robot, level_W, apart_s)))
    assert (found_W is not None) == free
    assert not free or found_W == pytest.approx(level_W, abs=0.4)


def test_a_constant_load_that_an_effect_hides_is_named_once_the_effect_is(robot):
    """The mean power of the friction and of the load cancel, so that the level looks small at first."""
    model = grey()
    reference = [recording(model, k, seed=1, rows=500, start_s=1e9 + MINUTES * k) for k in range(5)]

    def friction(scene, random):
        return extra_power(scene, column(scene, 1, 40.0 * scene.qd[:, 1]))

    new = [recording(model, k, friction, seed=2, rows=500, start_s=1e9 + 5000) for k in range(6)]
    plain = [recording(model, k, seed=2, rows=500, start_s=1e9 + 5000) for k in range(6)]
    mean_W = float(np.mean([np.mean(a.P - b.P) for a, b in zip(new, plain, strict=True)]))
    new = [replace(each, P=each.P - mean_W) for each in new]
    only = frozenset(COMMON | {"viscous_friction"})
    setup = set_up(Question(model, robot, new, reference, only, frozenset()), lambda _: None)
    assert mean_W > 0.015 * setup.design.columns.dynamic_range
    assert abs(level_difference(with_small_differences(setup))) < 0.5 * mean_W
    named = trace(setup, Limits(), lambda _: None).effects
    assert [each.id for each in named] == ["viscous_friction", "offset_shift"]
    assert float(named[1].finding.coefficients[0]) == pytest.approx(-mean_W, rel=0.2)


def test_a_drift_of_standby_power_is_no_loss_of_the_supply(robot):
    quiet = set_up_with(robot, 0.0, MINUTES)
    drifted = set_up_with(robot, 0.012 * quiet.design.columns.dynamic_range, MINUTES)
    assert not trace(drifted, Limits(), lambda _: None).effects
    changed = set_up_with(robot, 0.04 * quiet.design.columns.dynamic_range, MINUTES)
    named = trace(changed, Limits(), lambda _: None).effects
    assert [each.id for each in named] == ["offset_shift"]
    assert float(named[0].finding.coefficients[0]) == pytest.approx(0.04 * quiet.design.columns.dynamic_range, abs=0.6)
