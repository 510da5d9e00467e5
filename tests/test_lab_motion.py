"""Motion profiles, blending, the controller, and both excitation algorithms."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acqd.errors import InputError, UserError
from acqd.lab.cell import build_cell
from acqd.lab.motion.chain import Move, plan_chain
from acqd.lab.motion.controller import RATE, Controller, Phase, SwitchTool, Wait
from acqd.lab.motion.excitation import Cube, Excitation, planned_path
from acqd.lab.motion.profile import fastest_profile
from acqd.lab.motion.program import Planner
from acqd.lab.motion.trajectory import Trajectory, read_trajectory, write_trajectory
from acqd.lab.motion.use_case import Assembly
from acqd.lab.settings import LabSettings
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker, dense_path
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.scene import Box, Scene
from tools.common import mujoco_oracle

IIWA = load_description("iiwa7_r800")
positive = st.floats(0.05, 5.0)


@given(st.lists(st.floats(-3, 3).filter(lambda x: abs(x) > 1e-4), min_size=1, max_size=7), positive, positive)
@settings(max_examples=60, deadline=None)
def test_a_profile_keeps_its_limits_and_arrives(distance, speed, acceleration):
    distance = np.array(distance)
    profile = fastest_profile(distance, np.full(len(distance), speed), np.full(len(distance), acceleration))
    t = np.linspace(0, profile.duration, 2001)
    s, sd, sdd = profile.at(t)
    assert s[0] == 0 and s[-1] == pytest.approx(1.0, abs=1e-9)
    assert (np.diff(s) >= -1e-12).all()
    largest = np.abs(distance).max()
    assert (sd * largest).max() <= speed * (1 + 1e-6)
    assert np.abs(sdd * largest).max() <= acceleration * (1 + 1e-6)
    assert sd[-1] == pytest.approx(0, abs=1e-9) and sdd[-1] == pytest.approx(0, abs=1e-6)
    # one limit is used to the full: nothing faster exists without the smoothing
    used = max((sd * largest).max() / speed, np.abs(sdd * largest).max() / acceleration)
    assert used > 0.999 or profile.smoothing > profile.ramp


@given(st.integers(0, 10_000))
@example(369)  # a leg that ends before the one before it
@settings(max_examples=25, deadline=None)
def test_a_blended_chain_keeps_every_limit(seed):
    random = np.random.default_rng(seed)
    points = random.uniform(IIWA.lower, IIWA.upper, (8, 7))
    moves = [Move(q, float(random.uniform(0.2, 0.5)), 0.2, 1 - float(random.uniform(0, 0.5))) for q in points]
    chain = plan_chain(np.zeros(7), moves, IIWA.speed, IIWA.acceleration)
    q, qd, qdd = chain.sample(np.arange(0, chain.duration + 0.01, 1e-3))
    assert (np.abs(qd) <= 0.5 * IIWA.speed * (1 + 1e-6)).all()
    assert (np.abs(qdd) <= 0.4 * IIWA.acceleration * (1 + 1e-6)).all()
    assert (q >= IIWA.lower - 1e-9).all() and (q <= IIWA.upper + 1e-9).all()
    np.testing.assert_allclose(q[-1], points[-1], atol=1e-9)
    np.testing.assert_allclose(np.gradient(q, 1e-3, axis=0), qd, atol=2e-3)
    np.testing.assert_allclose(np.gradient(qd, 1e-3, axis=0), qdd, atol=0.08)
    starts = [leg.start for leg in chain.legs]
    assert starts == sorted(starts)
    assert all(later.start >= earlier.end - 1e-9 for earlier, later in zip(chain.legs, chain.legs[2:], strict=False))


def test_blending_saves_time_and_cuts_the_corner_but_not_without_it():
    corner = [np.array([0.6, 0, 0, 0, 0, 0, 0]), np.array([0.6, 0.6, 0, 0, 0, 0, 0])]
    sharp = plan_chain(np.zeros(7), [Move(q, 0.4, 0.2) for q in corner], IIWA.speed, IIWA.acceleration)
    soft = plan_chain(np.zeros(7), [Move(q, 0.4, 0.2, 0.6) for q in corner], IIWA.speed, IIWA.acceleration)
    assert soft.duration < sharp.duration - 0.1

    def nearest(chain):
        q = chain.sample(np.arange(0, chain.duration, 1e-3))[0]
        return np.linalg.norm(q - corner[0], axis=1).min()

    assert nearest(sharp) < 1e-3 < 0.02 < nearest(soft)


def test_the_brakes_open_before_motion_and_close_after_standstill():
    target = np.full(7, 0.2)
    motion = Controller(IIWA, np.zeros(7)).run([Wait(1.0), Move(target, 0.3, 0.2), Wait(14.0), Move(-target, 0.3, 0.2)])
    opened = np.flatnonzero(np.diff(motion.brake_open.astype(int)) == 1) + 1
    closed = np.flatnonzero(np.diff(motion.brake_open.astype(int)) == -1) + 1
    moving = np.flatnonzero(np.abs(motion.qd).max(axis=1) > 0)
    assert len(opened) == 2 and len(closed) == 1
    assert opened[0] == 1000 and moving[0] - opened[0] == pytest.approx(250, abs=2)
    rests = moving[np.argmax(np.diff(moving))]
    assert closed[0] - rests == pytest.approx(10_000, abs=3)
    assert motion.brake_open[moving].all()


def test_tool_and_phases_follow_the_program():
    program = [Phase("pick"), Move(np.full(7, 0.1), 0.3, 0.2), SwitchTool(True), Phase("carry"), Wait(0.5)]
    program += [SwitchTool(False), Wait(0.2)]
    motion = Controller(IIWA, np.zeros(7)).run(program)
    names = [motion.phase[k] for k in motion.phase_number]
    assert set(names) == {"pick", "carry"}
    assert motion.tool_on.sum() == pytest.approx(0.9 * RATE, abs=2)
    assert not motion.tool_on[-1]


@pytest.fixture(scope="module")
def cell():
    return build_cell(LabSettings())


@pytest.fixture(scope="module")
def drawn(cell):
    excitation = cell.excitation()
    limited = [excitation.limited_space(f"l{k}", Cube(), np.random.default_rng(k)) for k in range(3)]
    return limited, [excitation.all_space(f"a{k}", np.random.default_rng(k)) for k in range(3)]


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


def test_trajectories_survive_their_file(tmp_path, drawn):
    path = tmp_path / "t.csv"
    write_trajectory(path, drawn[0][0], IIWA)
    again = read_trajectory(path, IIWA)
    np.testing.assert_allclose(again.waypoints, drawn[0][0].waypoints, atol=1e-7)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("A1_deg,A2_deg\n1,2\n", "header A1_deg,A2_deg; expected A1_deg,A2_deg,A3_deg"),
        ("1,2,3,4,5,6\n", "has 6 columns, but iiwa7_r800 has 7 axes"),
        ("0,0,0,0,0,0,0\n0,130,0,0,0,0,0\n", "row 2: A2 = 130 deg is outside -120 .. 120 deg"),
        ("0,0,0,0,0,0,0\n0,,0,0,0,0,0\n", "row 2: column 2 is not a number"),
    ],
)
def test_a_broken_trajectory_is_named_where_it_is_broken(tmp_path, text, complaint):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        read_trajectory(path, IIWA)


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


def test_an_assembly_does_not_drive_through_what_stands_in_its_way(cell):
    post = Box(name="post", centre=(0.54, -0.14, 0.3), size=(0.03, 0.03, 0.6))
    blocked = Planner(cell.arm, CollisionChecker(cell.arm, Scene(name="blocked", box=[post])))
    with pytest.raises(UserError, match=r"the straight path to .* deg collides"):
        Assembly(cell.arm, blocked).program(np.random.default_rng(0))
    for controller in ("robot", "twin"):
        assembly = Assembly(cell.arm, cell.planner, controller)
        motion = Controller(IIWA, assembly.home()).run(assembly.program(np.random.default_rng(0)))
        assert not cell.checker.path_collides(planned_path(motion.q))


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


def test_a_trajectory_through_a_box_is_refused_with_the_place(cell):
    arm = Arm(IIWA)
    wall = Scene(name="wall", box=[Box(name="wall", centre=(0.5, 0.0, 0.6), size=(0.02, 0.4, 0.6))])
    planner = Planner(arm, CollisionChecker(arm, wall))
    side = np.radians([60, 60, 0, -40, 0, 0, 0])
    through = Trajectory("through", np.array([side, side * [-1, 1, 1, 1, 1, 1, 1]]))
    with pytest.raises(UserError, match="the straight path to -60 60 0 -40 0 0 0 deg collides"):
        planner.program(through, np.random.default_rng(0))
