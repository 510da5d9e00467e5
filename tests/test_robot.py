"""Kinematics, dynamics and collision of the shipped robots, against MuJoCo as an independent oracle."""

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.lab.motion.excitation import TOOL_DOWN
from acqd.robot import load_description, shipped_descriptions
from acqd.robot.arm import Arm, Payload
from acqd.robot.collision import CollisionChecker, dense_path, require_free
from acqd.robot.dynamics import (
    gravity_torque,
    inertial_parameters,
    inverse_dynamics,
    mechanical_energy,
    payload_parameters,
    payload_regressor,
    regressor,
)
from acqd.robot.kinematics import Pose, flange_jacobian, forward_kinematics, inverse_kinematics, joint_origins, unwound
from acqd.robot.scene import load_scene
from tools.common import mujoco_oracle

ROBOTS = shipped_descriptions()
PAYLOAD = Payload(1.3, (0.02, 0.01, 0.05), (0.02, 0.02, 0.03, 0.001, 0.002, 0.003))


def states(robot, count=200, seed=0):
    random = np.random.default_rng(seed)
    q = random.uniform(robot.lower, robot.upper, (count, robot.axes))
    return q, random.normal(size=q.shape), random.normal(size=q.shape) * 3


def test_four_robots_are_shipped():
    assert ROBOTS == ["iiwa7_r800", "kinova_gen3", "ur10e", "ur3e"]


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("payload", [None, PAYLOAD])
def test_inverse_dynamics_equals_mujoco(name, payload):
    robot = load_description(name)
    motion = states(robot)
    ours = inverse_dynamics(Arm(robot, payload), *motion)
    theirs = mujoco_oracle.inverse_dynamics(mujoco_oracle.build(robot, payload), *motion)
    assert np.abs(ours - theirs).max() <= 1e-9 * np.abs(theirs).max()


@pytest.mark.parametrize("name", ROBOTS)
def test_forward_kinematics_equals_mujoco(name):
    robot = load_description(name)
    q, _, _ = states(robot)
    for ours, theirs in zip(
        forward_kinematics(Arm(robot), q), mujoco_oracle.flange(mujoco_oracle.build(robot), q), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


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
    np.testing.assert_allclose(joint_origins(arm, q[0])[-1], forward_kinematics(arm, q[:1])[0][0])


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


@pytest.mark.parametrize(("name", "scene"), [(name, "free") for name in ROBOTS] + [("iiwa7_r800", "digital_factory")])
def test_collisions_are_those_that_mujoco_sees(name, scene):
    robot, surroundings = load_description(name), load_scene(scene)
    checker = CollisionChecker(Arm(robot), surroundings)
    random = np.random.default_rng(1)
    poses = random.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (150, robot.axes))
    seen = 0
    for q in poses:
        distance = mujoco_oracle.clearance(robot, surroundings, q[None])
        if abs(distance - surroundings.margin_m) > 1e-4:  # at the margin itself, rounding decides
            assert checker.collides(q) == (distance < surroundings.margin_m)
            seen += checker.collides(q)
    assert 5 < seen < 145


def test_a_path_is_checked_in_small_steps():
    path = dense_path(np.array([[0.0, 0.0], [0.5, -1.0], [0.5, -1.0]]), 0.1)
    assert np.abs(np.diff(path, axis=0)).max() <= 0.1 + 1e-12
    np.testing.assert_allclose(path[-1], [0.5, -1.0])


def test_a_collision_names_the_bodies():
    robot = load_description("iiwa7_r800")
    checker = CollisionChecker(Arm(robot), load_scene("digital_factory"))
    with pytest.raises(UserError, match=r"scene lab: the start is in collision \(.*box 'table'"):
        require_free(checker, np.radians([0, 110, 0, 0, 0, 0, 0]), "the start", "lab")


def test_an_unknown_robot_is_named_with_those_there_are():
    with pytest.raises(UserError, match="robot 'r2d2' is unknown; known: iiwa7_r800"):
        load_description("r2d2")


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("mass = 3.394011", "mass = -3.4", r"joint\.0\.link\.mass: .*greater than 0"),
        ("limits_deg = [-170, 170]", "limits_deg = [170, -170]", r"joint\.0\.limits_deg: expected \[lower, upper\]"),
        ('name = "A2"', 'name = "A1"', "joint names .* are not all different"),
        ("axis = [0, 0, 1]", "axes = [0, 0, 1]", r"joint\.0\.axes: there is no such key"),
        ("[base]", "[base", "is not valid TOML"),
    ],
)
def test_a_wrong_description_is_named_by_key(tmp_path, old, new, complaint):
    from acqd.robot import description

    text = (description._FOLDER / "iiwa7_r800.toml").read_text()
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=complaint):
        load_description(str(path))
