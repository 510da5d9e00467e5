"""Both excitation algorithms of the thesis."""

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.motion.controller import RATE, Controller
from acqd.motion.excitation import Cube, Excitation, planned_path
from acqd.robot.collision import CollisionChecker
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.scene import Box, Scene
from tests.lab.moved import IIWA
from tools.common import mujoco_oracle


def test_limited_space_points_lie_in_the_cube_with_the_tool_down(cell, drawn):
    for trajectory in drawn[0]:
        assert 40 <= len(trajectory.waypoints) <= 60
        positions, rotations = forward_kinematics(cell.arm, trajectory.waypoints)
        assert (np.abs(positions - [0.6, 0, 0.34]) <= 0.15 + 1e-6).all()
        np.testing.assert_allclose(rotations, np.tile(np.diag([-1.0, 1.0, -1.0]), (len(positions), 1, 1)), atol=1e-6)
        assert (trajectory.waypoints >= IIWA.lower).all() and (trajectory.waypoints <= IIWA.upper).all()


def test_all_space_trajectories_begin_at_zero_and_have_10_to_20_points(drawn):
    for trajectory in drawn[1]:
        assert 11 <= len(trajectory.waypoints) <= 21
        assert (trajectory.waypoints[0] == 0).all()


def test_executed_motions_collide_nowhere_at_half_a_degree(cell, drawn):
    for trajectory in [*drawn[0][:1], *drawn[1]]:
        program = cell.planner.program(trajectory, np.random.default_rng(1))
        motion = Controller(IIWA, trajectory.waypoints[0]).run(program)
        fine = motion.q[
            np.abs(np.diff(np.floor(np.cumsum(np.abs(motion.qd).max(axis=1)) / RATE / np.radians(0.5)), prepend=0)) > 0
        ]
        assert mujoco_oracle.clearance(IIWA, cell.scene, fine) > 0


def test_the_same_seed_draws_the_same_trajectories(cell, drawn):
    again = cell.excitation().all_space("a1", np.random.default_rng(1))
    np.testing.assert_array_equal(again.waypoints, drawn[1][1].waypoints)


def test_planned_paths_leave_no_large_step():
    q = np.cumsum(np.abs(np.random.default_rng(0).normal(0, 0.002, (5000, 7))), axis=0)
    steps = np.abs(np.diff(planned_path(q), axis=0)).max(axis=1)
    assert steps.max() <= np.radians(2.0)


@pytest.mark.slow  # the command is asked the same in tests/cli/lab
def test_a_cube_out_of_reach_is_said_to_be(cell):
    with pytest.raises(UserError, match=r"cube at 2 0 0.5 m with edge 0.3 m: .* could not be reached by iiwa7_r800"):
        cell.excitation().limited_space("x", Cube((2.0, 0.0, 0.5)), np.random.default_rng(0))


def test_a_scene_without_room_is_said_to_be(cell):
    box = Box(name="crate", centre=(0, 0, 1.0), size=(0.6, 0.6, 0.3))
    scene = Scene(name="crammed", box=[box])
    excitation = Excitation(cell.arm, CollisionChecker(cell.arm, scene), scene.name)
    with pytest.raises(UserError, match=r"scene crammed: the start position .* is in collision .*box 'crate'"):
        excitation.all_space("x", np.random.default_rng(0))


def test_the_thesis_check_accepts_ways_that_a_fine_check_refuses(cell):
    coarse, fine = cell.excitation(thesis=True), cell.excitation()
    coarse_drawn = [coarse.all_space("x", np.random.default_rng(k)) for k in range(12)]
    for k in range(12):
        fine.all_space("x", np.random.default_rng(k))
    collisions = sum(
        cell.checker.path_collides(np.concatenate([[a], a + np.linspace(0, 1, 200)[:, None] * (b - a)]))
        for trajectory in coarse_drawn
        for a, b in zip(trajectory.waypoints, trajectory.waypoints[1:], strict=False)
    )
    assert collisions > 0
    assert coarse.tally.colliding < fine.tally.colliding
