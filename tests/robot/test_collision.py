"""Collisions against MuJoCo."""

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker, dense_path, require_free
from acqd.robot.scene import load_scene
from tests.robot.states import ROBOTS
from tools.common import mujoco_oracle

OUTLINED = [name for name in ROBOTS if load_description(name).joint[0].capsules]


@pytest.mark.parametrize(("name", "scene"), [(name, "free") for name in OUTLINED] + [("iiwa7_r800", "digital_factory")])
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
