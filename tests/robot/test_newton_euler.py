"""Rigid-body dynamics in numpy against Pinocchio."""

import numpy as np
import pytest

from acqd.robot import load_description
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import gravity_torque
from acqd.robot.newton_euler import Chain, frames, weight_torque


@pytest.mark.parametrize("name", ["iiwa7_r800", "ur10e"])
def test_weights_on_links_are_pinocchios(name):
    description = load_description(name)
    q = np.random.default_rng(5).uniform(-2, 2, (30, description.axes))
    where = frames(Chain.of(description), q)
    heavy = gravity_torque(Arm(description, Payload(1.0)), q) - gravity_torque(Arm(description), q)
    tip = Chain.of(description).beyond_flange(0.0)
    assert np.abs(weight_torque(where, description.axes - 1, tip) - heavy).max() < 1e-9
