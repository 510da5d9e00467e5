"""The tile says which way a quantity has changed, and of several joints the one that has."""

from types import SimpleNamespace

import pytest

from acqd.discrepancy.causes.belief import NOTHING, OUTSIDE, Belief
from acqd.discrepancy.report import causes
from acqd.discrepancy.report.main_parameter import changed_place, main_parameter
from acqd.discrepancy.report.tile import _headline, _size, directed
from acqd.models.effects import library
from tests.discrepancy.report.subjects import found, subject_with

DRY = library()["coulomb_friction"].summary


@pytest.fixture
def subject(model):
    return subject_with(model)


@pytest.mark.parametrize(("value", "word"), [(17.1, "is higher than"), (-17.1, "is lower than")])
def test_a_clear_sign_gives_the_direction(value, word):
    assert word in directed(DRY, {"value": value, "ci95": [value - 2, value + 2]})


def test_an_interval_over_zero_leaves_both_directions():
    assert directed(DRY, {"value": 0.1, "ci95": [-0.2, 0.4]}) == DRY


def test_of_several_joints_the_changed_one_is_shown(subject):
    effect = found("coulomb_friction", {"torque joint 1": (0.2, 0.4), "torque joint 2": (-9.1, 0.6)})
    assert main_parameter(effect)[0] == "torque joint 2"
    assert _size(subject, effect).value.startswith("-9.1")
    assert changed_place(effect) == "joint 2"
    assert _size(subject, found("coulomb_friction", {"torque": (17.1, 1.9)})).value == "+17.1 Nm"


def test_a_fitted_shape_is_not_the_size():
    effect = found("stribeck_friction", {"torque": (25.0, 2.0), "speed": (0.15, 0.001)}, {"speed": 0.15})
    assert main_parameter(effect)[0] == "torque"


@pytest.mark.parametrize(("nothing", "says"), [(0.53, "whether anything has changed"), (0.0, "Something differs")])
def test_the_headline_does_not_claim_a_change_where_the_set_holds_nothing(monkeypatch, nothing, says):
    belief = Belief({NOTHING: nothing, OUTSIDE: 1 - nothing}, (NOTHING, OUTSIDE))
    monkeypatch.setattr(causes, "believed", lambda closed: belief)
    assert says in _headline(SimpleNamespace(verdict="not_identifiable"))
