"""Programs that collide with nothing."""

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.motion.controller import Controller
from acqd.motion.excitation import planned_path
from acqd.motion.program import Planner
from acqd.motion.trajectory import Trajectory
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker, dense_path
from acqd.robot.scene import Box, Scene
from tests.lab.moved import IIWA


def test_a_position_given_twice_hides_no_collision(cell):
    """Found by review: a leg of no length shifted the blends that were taken away."""
    random = np.random.default_rng(3)
    for _ in range(6):
        trajectory = cell.excitation().all_space("x", random)
        twice = Trajectory("twice", np.concatenate([trajectory.waypoints[:1], trajectory.waypoints]))
        programs = [cell.planner.program(t, np.random.default_rng(5)) for t in (trajectory, twice)]
        motions = [Controller(IIWA, trajectory.waypoints[0]).run(program) for program in programs]
        np.testing.assert_allclose(motions[0].q, motions[1].q)
        assert not cell.checker.path_collides(planned_path(motions[1].q))


def test_transfers_go_round_what_stands_in_the_way(cell):
    wall = Scene(name="wall", box=[Box(name="wall", centre=(0.5, 0.0, 0.4), size=(0.02, 0.5, 1.0))])
    planner = Planner(cell.arm, CollisionChecker(cell.arm, wall))
    side = np.radians([60, 60, 0, -40, 0, 0, 0])
    start, end = side, side * [-1, 1, 1, 1, 1, 1, 1]
    assert planner.checker.path_collides(dense_path(np.array([start, end]), np.radians(1)))
    moves = planner.connect(start, end)
    assert len(moves) > 1
    way = np.array([start, *(move.target for move in moves)])
    np.testing.assert_array_equal(way[-1], end)
    assert not planner.checker.path_collides(dense_path(way, np.radians(0.5)))
    again = planner.connect(start, end)
    np.testing.assert_array_equal(way[1:], [move.target for move in again])


class _Band(CollisionChecker):
    """Collides while axis 1 is between two angles [deg]."""

    def __init__(self, lowest, highest):
        self._limits = np.radians([lowest, highest])

    def collides(self, q):
        return bool(self._limits[0] < q[0] < self._limits[1])


def test_a_trajectory_is_executed_where_its_drawing_was_free(cell):
    """Seed 8 of a campaign of 40 recordings: a path came within the margin of a box between two checked positions."""
    path = Trajectory("path", np.radians([[0.0] + 6 * [0.0], [10.0] + 6 * [0.0]]))
    between = Planner(cell.arm, _Band(2.05, 3.95))  # drawn paths are checked at 0, 2, 4 .. 10 deg
    assert len(between.program(path, np.random.default_rng(0))) == 3
    with pytest.raises(UserError, match="collides"):
        Planner(cell.arm, _Band(1.95, 3.95)).program(path, np.random.default_rng(0))


def test_a_trajectory_through_a_box_is_refused_with_the_place(cell):
    arm = Arm(IIWA)
    wall = Scene(name="wall", box=[Box(name="wall", centre=(0.5, 0.0, 0.6), size=(0.02, 0.4, 0.6))])
    planner = Planner(arm, CollisionChecker(arm, wall))
    side = np.radians([60, 60, 0, -40, 0, 0, 0])
    through = Trajectory("through", np.array([side, side * [-1, 1, 1, 1, 1, 1, 1]]))
    with pytest.raises(UserError, match="the straight path to -60 60 0 -40 0 0 0 deg collides"):
        planner.program(through, np.random.default_rng(0))
