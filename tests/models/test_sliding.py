"""Prismatic joints in models: units, bundles, places."""

import numpy as np

from acqd.models.effects.places import Parameter, in_units_of, per_joint
from acqd.models.greybox.bundle_io import arrays_of, restore
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import Layout, prior
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inertial_parameters, inverse_dynamics
from acqd.robot.newton_euler import Chain
from tests.robot.sliding import scara
from tests.robot.states import states

ROBOT = scara()


def grey_box():
    layout = Layout(ROBOT.axes, (), ROBOT.sliding)
    mean = prior(layout, ROBOT, inertial_parameters(Arm(ROBOT)), 80.0, 0.04).mean
    return GreyBox(Chain.of(ROBOT), layout, mean, 0.04)


def test_a_grey_box_computes_the_force_of_a_slide_and_keeps_it_in_its_bundle():
    model = grey_box()
    metadata = {"axes": 4, "signals": [], "step_s": 0.04, "sliding": [2]}
    motion = states(ROBOT, 20)
    wanted = inverse_dynamics(Arm(ROBOT), *motion)
    for each in (model, restore(metadata, arrays_of(model))):
        np.testing.assert_allclose(each.motor_torque(*motion)[0], wanted, atol=1e-9)


def test_parameters_of_a_slide_have_their_units():
    units = dict(grey_box().layout.names())
    assert [units[f"{name}.joint3"] for name in ("rotor", "coulomb", "viscous", "copper", "conduction")] == [
        "kg",
        "N",
        "N s/m",
        "W/N^2",
        "W/N",
    ]
    assert units["coulomb.joint2"] == "Nm"


def test_an_effect_at_a_slide_has_its_units():
    places = [in_units_of(place, (2,)) for place in per_joint(4, Parameter("coefficient", "Nm s/rad"))]
    units = {place.where: [each.unit for each in place.parameters] for place in places}
    assert units["joint 3"] == ["N s/m"]
    assert units["joint 2"] == ["Nm s/rad"]
    assert units["each joint"] == ["Nm s/rad", "Nm s/rad", "N s/m", "Nm s/rad"]
