"""Dynamics against MuJoCo as an independent oracle."""

import numpy as np
import pytest

from acqd.robot import load_description
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import (
    gravity_torque,
    inertial_parameters,
    inverse_dynamics,
    mechanical_energy,
    payload_parameters,
    payload_regressor,
    regressor,
)
from tests.robot.states import ROBOTS, states
from tools.common import mujoco_oracle

PAYLOAD = Payload(1.3, (0.02, 0.01, 0.05), (0.02, 0.02, 0.03, 0.001, 0.002, 0.003))


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("payload", [None, PAYLOAD])
def test_inverse_dynamics_equals_mujoco(name, payload):
    robot = load_description(name)
    motion = states(robot)
    ours = inverse_dynamics(Arm(robot, payload), *motion)
    theirs = mujoco_oracle.inverse_dynamics(mujoco_oracle.build(robot, payload), *motion)
    assert np.abs(ours - theirs).max() <= 1e-9 * np.abs(theirs).max()


@pytest.mark.parametrize("name", ROBOTS)
def test_torque_is_linear_in_the_inertial_parameters(name):
    robot = load_description(name)
    arm, motion = Arm(robot), states(robot, 50)
    tau = inverse_dynamics(arm, *motion)
    np.testing.assert_allclose(regressor(arm, *motion) @ inertial_parameters(arm), tau, atol=1e-10)
    added = inverse_dynamics(Arm(robot, PAYLOAD), *motion) - tau
    np.testing.assert_allclose(payload_regressor(robot, *motion) @ payload_parameters(PAYLOAD), added, atol=1e-10)


@pytest.mark.parametrize("name", ROBOTS)
def test_power_is_the_rate_of_change_of_energy(name):
    robot = load_description(name)
    arm = Arm(robot)
    t = np.arange(0, 2, 1e-3)
    phase = np.arange(robot.axes)
    q = 0.5 * np.sin(t[:, None] + phase)
    qd, qdd = 0.5 * np.cos(t[:, None] + phase), -0.5 * np.sin(t[:, None] + phase)
    power = (inverse_dynamics(arm, q, qd, qdd) * qd).sum(axis=1)
    energy = mechanical_energy(arm, q, qd)
    work = np.trapezoid(power, t)
    assert energy[-1] - energy[0] == pytest.approx(work, abs=1e-5)
    rest = np.zeros_like(q)
    np.testing.assert_allclose(gravity_torque(arm, q), inverse_dynamics(arm, q, rest, rest), atol=1e-12)
