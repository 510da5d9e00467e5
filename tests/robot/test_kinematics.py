"""Kinematics against MuJoCo and against geometry."""

import numpy as np
import pytest

from acqd.motion.excitation import TOOL_DOWN
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.kinematics import Pose, flange_jacobian, forward_kinematics, inverse_kinematics, unwound
from tests.robot.states import ROBOTS, states
from tools.common import mujoco_oracle


@pytest.mark.parametrize("name", ROBOTS)
def test_forward_kinematics_equals_mujoco(name):
    robot = load_description(name)
    q, _, _ = states(robot)
    for ours, theirs in zip(
        forward_kinematics(Arm(robot), q), mujoco_oracle.flange(mujoco_oracle.build(robot), q), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize("name", ROBOTS)
def test_jacobian_is_the_derivative_of_the_flange_position(name):
    robot = load_description(name)
    arm = Arm(robot)
    q, _, _ = states(robot, 5)
    step = 1e-6
    for axis in range(robot.axes):
        moved = q + step * np.eye(robot.axes)[axis]
        slope = (forward_kinematics(arm, moved)[0] - forward_kinematics(arm, q)[0]) / step
        np.testing.assert_allclose(flange_jacobian(arm, q)[:, :3, axis], slope, atol=1e-5)


@pytest.mark.parametrize("name", ROBOTS)
def test_inverse_kinematics_finds_every_reachable_pose_within_the_limits(name):
    robot = load_description(name)
    arm, random = Arm(robot), np.random.default_rng(3)
    q, _, _ = states(robot, 60, seed=4)
    for position, rotation in zip(*forward_kinematics(arm, q), strict=True):
        found = inverse_kinematics(arm, Pose(position, rotation), np.zeros(robot.axes), random)
        assert found is not None
        assert (found >= robot.lower).all() and (found <= robot.upper).all()
        again = forward_kinematics(arm, found[None])
        np.testing.assert_allclose(again[0][0], position, atol=1e-6)
        np.testing.assert_allclose(again[1][0], rotation, atol=1e-6)


def test_a_posture_is_reached_without_needless_turns():
    robot = load_description("ur10e")
    q = np.radians([10.0, 247.0, -114.0, -223.0, -90.0, 300.0])
    shorter = unwound(q, np.zeros(6), robot.lower, robot.upper)
    np.testing.assert_allclose(np.degrees(shorter), [10, -113, -114, 137, -90, -60])
    arm = Arm(robot)
    np.testing.assert_allclose(
        forward_kinematics(arm, q[None])[0], forward_kinematics(arm, shorter[None])[0], atol=1e-9
    )
    np.testing.assert_array_equal(unwound(q, q, robot.lower, robot.upper), q)


def reachable_by_geometry(position):
    """Closed form for the iiwa's S-R-S structure: some arm angle gives axis values within the limits.

    Shoulder at z = .340, upper arm and forearm .400, wrist .126 before the flange; tool down.
    """
    wrist = position + np.array([0, 0, 0.126])
    shoulder = np.array([0, 0, 0.340])
    reach = wrist - shoulder
    distance = np.linalg.norm(reach)
    if distance >= 0.8:
        return False
    elbow_angle = np.pi - np.arccos(1 - distance**2 / (2 * 0.4**2))
    if elbow_angle > np.radians(120):
        return False
    along = reach / distance
    aside = np.cross(along, [0, 0, 1.0])
    aside /= np.linalg.norm(aside)
    height = np.sqrt(0.4**2 - (distance / 2) ** 2)
    for angle in np.linspace(-np.pi, np.pi, 73):
        out = np.cos(angle) * np.cross(aside, along) + np.sin(angle) * aside
        elbow = shoulder + along * distance / 2 + out * height
        upper, lower = (elbow - shoulder) / 0.4, (wrist - elbow) / 0.4
        shoulder_tilt = np.arccos(np.clip(upper[2], -1, 1))
        wrist_tilt = np.arccos(np.clip(-lower[2], -1, 1))
        if max(shoulder_tilt, wrist_tilt) < np.radians(119):
            return True  # axes 1, 3, 5, 7 have +-170 deg; some arm angle nearby suits them
    return False


def test_inverse_kinematics_agrees_with_geometry_in_the_thesis_cube():
    robot = load_description("iiwa7_r800")
    arm, random = Arm(robot), np.random.default_rng(8)
    corners = np.array([[x, y, z] for x in (0.45, 0.75) for y in (-0.15, 0.15) for z in (0.19, 0.49)])
    points = np.concatenate([corners, np.array([0.6, 0, 0.34]) + random.uniform(-0.15, 0.15, (200, 3))])
    seed = np.zeros(7)
    for point in points:
        found = inverse_kinematics(arm, Pose(point, TOOL_DOWN), seed, random)
        assert (found is not None) == reachable_by_geometry(point), point
