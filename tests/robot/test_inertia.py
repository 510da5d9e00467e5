"""Inverse dynamics without a robot library, against Pinocchio."""

import numpy as np
import pytest

from acqd.robot import dynamics, inertia, load_description, shipped_descriptions
from acqd.robot.arm import Arm


@pytest.mark.parametrize("name", shipped_descriptions())
def test_torques_of_shipped_robots_equal_pinocchios(name):
    robot = load_description(name)
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 20, robot.axes))
    np.testing.assert_allclose(
        inertia.inverse_dynamics(robot, q, qd, qdd), dynamics.inverse_dynamics(Arm(robot), q, qd, qdd), atol=1e-10
    )
