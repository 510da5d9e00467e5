"""The tile says which way a quantity has changed, and of several joints the one that has."""

import numpy as np
import pytest

from acqd.discrepancy.repair.terms import Added
from acqd.discrepancy.report.main_parameter import changed_place, main_parameter
from acqd.discrepancy.report.tile import _size, directed
from acqd.models.augmented import Term
from acqd.models.effects import library

DRY = library()["coulomb_friction"].summary


def found(identity, parameters, shape=None):
    """An added effect with parameters as (value, half width)."""
    values = {
        name: {"value": value, "unit": "Nm", "ci95": [value - half, value + half]}
        for name, (value, half) in parameters.items()
    }
    term = Term(identity, "each joint", shape or {}, (0,), np.zeros(1), values)
    return Added(term, evidence=1e3, confidence=0.98, alternatives=[], start=None, consistency=1.0, recordings=6)


@pytest.mark.parametrize(("value", "word"), [(17.1, "is higher than"), (-17.1, "is lower than")])
def test_a_clear_sign_gives_the_direction(value, word):
    assert word in directed(DRY, {"value": value, "ci95": [value - 2, value + 2]})


def test_an_interval_over_zero_leaves_both_directions():
    assert directed(DRY, {"value": 0.1, "ci95": [-0.2, 0.4]}) == DRY


def test_of_several_joints_the_changed_one_is_shown():
    effect = found("coulomb_friction", {"torque joint 1": (0.2, 0.4), "torque joint 2": (-9.1, 0.6)})
    assert main_parameter(effect)[0] == "torque joint 2"
    assert _size(effect).value.startswith("-9.1")
    assert changed_place(effect) == "joint 2"
    assert _size(found("coulomb_friction", {"torque": (17.1, 1.9)})).value == "+17.1 Nm"


def test_a_fitted_shape_is_not_the_size():
    effect = found("stribeck_friction", {"torque": (25.0, 2.0), "speed": (0.15, 0.001)}, {"speed": 0.15})
    assert main_parameter(effect)[0] == "torque"
