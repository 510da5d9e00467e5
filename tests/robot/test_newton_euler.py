"""Rigid-body dynamics in numpy against Pinocchio."""

import numpy as np
import pytest

from acqd.robot import load_description
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import gravity_torque, inertial_parameters, inverse_dynamics
from acqd.robot.newton_euler import Chain, frames, joint_torque, weight_torque


@pytest.mark.parametrize("name", ["iiwa7_r800", "ur10e"])
def test_weights_on_links_are_pinocchios(name):
    description = load_description(name)
    q = np.random.default_rng(5).uniform(-2, 2, (30, description.axes))
    where = frames(Chain.of(description), q)
    heavy = gravity_torque(Arm(description, Payload(1.0)), q) - gravity_torque(Arm(description), q)
    tip = Chain.of(description).beyond_flange(0.0)
    assert np.abs(weight_torque(where, description.axes - 1, tip) - heavy).max() < 1e-9


@pytest.mark.parametrize("robot", ["iiwa7_r800", "ur3e", "ur10e", "kinova_gen3"])
def test_newton_euler_agrees_with_pinocchio(robot):
    description = load_description(robot)
    arm = Arm(description)
    q, qd, qdd = np.random.default_rng(3).normal(0, 2, (3, 40, arm.axes))
    own = joint_torque(Chain.of(description), inertial_parameters(arm), q, qd, qdd)
    assert np.abs(own - inverse_dynamics(arm, q, qd, qdd)).max() < 1e-9
