"""Places of an effect: bounds and priors of its parameters."""

import numpy as np
import pytest

from acqd.models.effects.places import Parameter, Place, Variant, per_joint


def by_place(nominal):
    return {place.where: place for place in per_joint(3, Parameter("torque", "Nm"), nominal=nominal)}


def test_a_change_of_a_described_value_is_usually_no_larger_than_the_value():
    places = by_place(np.array([4.0, 2.0, 0.0]))
    single = [places[f"joint {k}"].parameters[0] for k in (1, 2, 3)]
    assert [each.deviation for each in single] == [4.0, 2.0, pytest.approx(2.0)]  # not described: the mean
    assert [each.low for each in single] == [-4.0, -2.0, 0.0]
    together = places["all joints"].parameters[0]
    assert (together.name, together.unit, together.low, together.deviation) == ("torque, relative", "-", -1.0, 1.0)
    assert [each.name for each in places["each joint"].parameters] == [f"torque joint {k}" for k in (1, 2, 3)]


def test_equal_described_values_keep_their_unit():
    together = by_place(np.full(3, 5.0))["all joints"]
    assert (together.parameters[0].unit, together.parameters[0].deviation) == ("Nm", 5.0)
    assert together.mix == pytest.approx(np.ones((3, 1)))


def test_without_any_description_nothing_is_known_of_the_size():
    places = by_place(np.zeros(3))
    assert "all joints" not in places
    assert np.isinf(places["joint 1"].parameters[0].deviation)


def test_a_difference_may_be_negative_where_the_whole_may_not():
    friction = Parameter("torque", "Nm", whole_low=0.0, deviation=2.0)
    difference = Variant(Place("joint 1", (0,), (friction,)), (0,))
    assert difference.place.parameters[0].low == -np.inf
    assert difference.without_reference().place.parameters[0].low == 0.0
    assert difference.precision == pytest.approx([0.25])
    assert Variant(Place("meter", (0,), (Parameter("gain", "-"),)), (0,)).precision == pytest.approx([0.0])
