"""Postures, gravity and inertias in plain numpy, against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from acqd.robot import dynamics, load_description
from acqd.robot.arm import Arm
from acqd.robot.inertia import central_tensor, gravity_torque
from acqd.robot.posture import Posture
from tests.robot.sliding import scara
from tests.robot.states import ROBOTS, states

DESCRIPTIONS = [*map(load_description, ROBOTS), scara()]


@pytest.mark.parametrize("robot", DESCRIPTIONS, ids=lambda each: each.name)
def test_bodies_are_where_pinocchio_places_them(robot):
    arm, q = Arm(robot), states(robot, 1)[0][0]
    pin.framesForwardKinematics(arm.model, arm.data, q)
    posture = Posture.of(robot, q)
    for k, frame in enumerate(arm.data.oMi):
        np.testing.assert_allclose(
            posture.placed(k, (0.1, -0.2, 0.3)), frame.act(np.array([0.1, -0.2, 0.3])), atol=1e-12
        )
    np.testing.assert_allclose(posture.points[-1], arm.data.oMf[arm.flange].translation, atol=1e-12)


@pytest.mark.parametrize("robot", DESCRIPTIONS, ids=lambda each: each.name)
def test_gravity_and_tensors_equal_those_of_pinocchio(robot):
    arm, q = Arm(robot), states(robot, 20)[0]
    np.testing.assert_allclose(gravity_torque(robot, q), dynamics.gravity_torque(arm, q), atol=1e-9)
    for joint, body in zip(robot.joint, list(arm.model.inertias)[1:], strict=True):
        np.testing.assert_allclose(central_tensor(joint.link), body.inertia, atol=1e-12)
