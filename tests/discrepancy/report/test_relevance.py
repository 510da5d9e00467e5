"""A size stands beside what the robot has, and the power beside its energy."""

from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.report.relevance import compared_with_robot as compared
from acqd.discrepancy.report.relevance import mean_power
from tests.discrepancy.report.subjects import found, subject_with


@pytest.fixture
def subject(model):
    return subject_with(model)  # 5 Nm of dry friction, 6 Nm s/rad, standby 120 W; limits of 330 Nm at joint 2


def test_friction_stands_beside_that_of_the_model_and_the_limit_of_the_joint(subject):
    friction = found("coulomb_friction", {"torque joint 1": (0.2, 0.4), "torque joint 2": (24.0, 1.0)})
    assert compared(subject, friction) == "the model has 5.0 Nm; the change is 7.3 % of the joint's limit of 330 Nm"
    viscous = found("viscous_friction", {"coefficient": (8.0, 1.0)}, where="joint 3", unit="Nm s/rad")
    assert compared(subject, viscous) == "the model has 6.0 Nm s/rad"


def test_a_quantity_that_the_model_lacks_has_no_usual_value(model):
    friction = found("coulomb_friction", {"torque": (24.0, 1.0)}, where="joint 2")
    assert (
        compared(subject_with(model, withheld=frozenset({"coulomb"})), friction)
        == "the change is 7.3 % of the joint's limit of 330 Nm"
    )


def test_a_mass_stands_beside_the_torque_that_holds_it(subject):
    place = {"shape": {"centre_of_mass_m": 0.05}, "where": "flange", "unit": "kg"}
    text = compared(subject, found("payload", {"mass": (10.0, 0.1)}, **place))
    share = float(text.split(" up to ")[1].split(" %")[0]) / 100
    reach_m = 1.4  # of a UR10e: from the shoulder to the flange; its elbow has a limit of 150 Nm
    assert 0.05 < share < 10.0 * 9.81 * reach_m / 150
    assert "torque limit of joint " in text
    assert (
        compared(subject, found("payload", {"mass": (-2.0, 0.1)}, **place)) == ""
    )  # a mass that has gone loads nothing


def test_what_has_no_usual_value_says_nothing(subject):
    assert compared(subject, found("meter_gain", {"gain error": (0.03, 0.001)}, where="meter", unit="-")) == ""
    standby = compared(subject, found("offset_shift", {"power": (8.0, 1.0)}, where="cabinet", unit="W"))
    assert standby == "the standby power of the model is 120 W"


def closed(subject, before, after, kept=True):
    return SimpleNamespace(subject=subject, extended=kept, errors_before=before, errors_after=after)


def test_the_power_on_average_becomes_energy_per_day(subject):
    names = [SimpleNamespace(recording=f"r{k}") for k in range(6)]
    with_names = SimpleNamespace(held_out=names)
    before = [np.full(100, 30.0 + k) for k in range(6)]
    (figure,) = mean_power(closed(with_names, before, [np.zeros(100)] * 6))
    assert figure.value == "+32.5 W"
    assert figure.note.startswith("0.78 kWh a day") and "(6 recordings)" in figure.note
    assert mean_power(closed(with_names, before, before, kept=False)) == []
