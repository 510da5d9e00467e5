"""Rigid-body dynamics in numpy against Pinocchio."""

import numpy as np
import pytest

from acqd.models.effects.bodies import point_mass
from acqd.robot import load_description
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import gravity_torque, inertial_parameters, inverse_dynamics
from acqd.robot.newton_euler import Chain, joint_torque, joint_torques, torques_in_numpy
from acqd.robot.rigid_body import library
from tests.robot.test_prismatic import scara


@pytest.mark.parametrize("name", ["iiwa7_r800", "ur10e"])
def test_a_weight_at_the_flange_is_pinocchios(name):
    description = load_description(name)
    q = np.random.default_rng(5).uniform(-2, 2, (30, description.axes))
    heavy = gravity_torque(Arm(description, Payload(1.0)), q) - gravity_torque(Arm(description), q)
    chain, bodies = Chain.of(description), np.zeros((description.axes, 10))
    bodies[-1] = point_mass(chain.beyond_flange(0.0))
    assert np.abs(joint_torque(chain, bodies.ravel(), q, 0 * q, 0 * q) - heavy).max() < 1e-9


@pytest.mark.parametrize("name", ["iiwa7_r800", "kinova_gen3", "scara"])
@pytest.mark.parametrize("rows", [1, 8, 4099])
def test_compiled_torques_are_those_of_numpy(name, rows):
    if library() is None:
        pytest.skip("no C compiler")
    description = scara() if name == "scara" else load_description(name)
    chain, random = Chain.of(description), np.random.default_rng(7)
    motion = random.normal(0, 2, (3, rows, description.axes))
    arms = random.normal(0, 1, (3, description.axes, 10))
    arms[1, :-1] = arms[2, 1:] = 0.0
    in_numpy = torques_in_numpy(chain, arms, *motion)
    np.testing.assert_allclose(joint_torques(chain, arms, *motion), in_numpy, atol=1e-12 * np.abs(in_numpy).max())


@pytest.mark.parametrize("robot", ["iiwa7_r800", "ur3e", "ur10e", "kinova_gen3"])
def test_newton_euler_agrees_with_pinocchio(robot):
    description = load_description(robot)
    arm = Arm(description)
    q, qd, qdd = np.random.default_rng(3).normal(0, 2, (3, 40, arm.axes))
    own = joint_torque(Chain.of(description), inertial_parameters(arm), q, qd, qdd)
    assert np.abs(own - inverse_dynamics(arm, q, qd, qdd)).max() < 1e-9


def test_motions_and_bodies_of_other_shapes_and_types_are_those_of_numpy():
    chain = Chain.of(load_description("ur10e"))
    q, arms = np.random.default_rng(1).normal(0, 1, (50, 6)), np.ones((1, 6, 10), np.float32)
    found = joint_torques(chain, arms, q, np.ones((1, 6)), np.zeros((1, 6)))
    np.testing.assert_allclose(found, joint_torques(chain, arms.astype(float), q, np.ones_like(q), np.zeros_like(q)))
    if library() is not None:
        with pytest.raises(ValueError, match="broadcast"):
            joint_torques(chain, arms, q, q[:20], q)
