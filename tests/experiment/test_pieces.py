"""Pieces of motion and programs keep limits, workspace and obstacles."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from acqd.errors import UserError
from acqd.experiment.pieces import least_s, motion_of, pieces_of
from acqd.experiment.space import Space
from acqd.motion.chain import Move
from acqd.motion.controller import Wait
from acqd.motion.program_text import programs
from acqd.robot.arm import Arm
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.scene import Scene, load_scene
from tests.builders import ROBOT, STEP, recording
from tests.lab.moved import IIWA


@pytest.fixture(scope="module")
def arm():
    return Arm(ROBOT)


@pytest.fixture(scope="module")
def segments(model):
    return [recording(model, number, rows=400) for number in range(3)]


def space_of(arm, segments, share=1.0, workspace=None, scene=None):
    return Space.of(arm, scene or load_scene("free"), segments, STEP, share, workspace)


@pytest.fixture(scope="module")
def space(arm, segments):
    return space_of(arm, segments)


@pytest.fixture(scope="module")
def pieces(space):
    return pieces_of(space, 1)


def test_every_piece_begins_and_ends_at_home_at_rest(space, pieces):
    assert len(pieces) > 40
    for piece in pieces[::5]:
        motion = motion_of(space, piece.steps)
        assert np.allclose(motion.q[[0, -1]], space.home, atol=1e-6), piece.name
        assert np.allclose(motion.qd[[0, -1]], 0, atol=1e-6), piece.name


def test_pieces_that_outlast_the_program_are_not_executed(space, pieces, monkeypatch):
    assert all(least_s(space, piece.steps) <= piece.seconds for piece in pieces)
    executed = []

    def recorded(*arguments):
        executed.append(motion_of(*arguments))
        return executed[-1]

    monkeypatch.setattr("acqd.experiment.pieces.motion_of", recorded)
    made = pieces_of(replace(space, speed=space.speed / 300), 1, longest_s=10.0)
    assert made and all(piece.seconds <= 10.0 for piece in made)
    assert max(motion.seconds for motion in executed) < 60.0 < least_s(space, pieces[-1].steps) * 300


def test_a_sequence_of_pieces_keeps_all_limits(space, pieces):
    random = np.random.default_rng(5)
    steps = [step for k in random.integers(len(pieces), size=12) for step in pieces[k].steps]
    motion = motion_of(space, tuple(steps))
    assert space.broken_limit(motion) is None
    assert (np.abs(motion.qd) <= space.speed * (1 + 1e-6)).all()


def test_every_piece_is_as_fast_as_some_joint_allows(space, pieces):
    """A synchronous motion waits for the joint with the least room, and for no other one."""
    for piece in pieces:
        motion = motion_of(space, piece.steps)
        speed, acceleration = (np.abs(motion.qd) / space.speed).max(), (np.abs(motion.qdd) / space.acceleration).max()
        assert speed == 0.0 or acceleration > 0.9, piece.name


def test_a_joint_that_has_never_moved_stays_at_rest(arm, segments):
    still = [replace(segment, q=np.where(np.arange(6) == 5, 0.3 * k, segment.q)) for k, segment in enumerate(segments)]
    space = space_of(arm, still)
    pieces = pieces_of(space, 1)
    assert pieces and not any(piece.name.startswith("wrist_3") for piece in pieces)
    for piece in pieces[::9]:
        assert np.ptp(motion_of(space, piece.steps).q[:, 5]) < 1e-9


def test_speeds_stay_below_measured_ones_and_below_the_asked_share(arm, segments, space):
    measured = np.concatenate([np.abs(segment.motion(STEP)[1]) for segment in segments]).max(axis=0)
    assert (space.speed <= measured).all()
    assert (space_of(arm, segments, share=0.01).speed <= 0.01 * ROBOT.speed + 1e-12).all()


def test_pieces_are_as_smooth_as_the_measured_motion(arm, segments):
    """The same way at a third of the pace: speed / 3, acceleration / 9, jerk / 27. A short move turns at twice that."""
    calm = [replace(each, q=_drawn_out(each.q, 3)) for each in segments]
    brisk, slow = space_of(arm, segments), space_of(arm, calm)
    assert (slow.acceleration < brisk.acceleration / 6).all()
    measured = np.max([np.abs(np.diff(each.motion(STEP)[2], axis=0)).max(axis=0) / STEP for each in calm], axis=0)
    for piece in pieces_of(slow, 1)[::7]:
        qdd = motion_of(slow, piece.steps).qdd
        rows = round(1000 * STEP)
        assert (np.abs(qdd[rows:] - qdd[:-rows]).max(axis=0) / STEP <= 2.02 * measured).all(), piece.name


def _drawn_out(q, times):
    rows = np.arange(times * (len(q) - 1) + 1) / times
    return CubicSpline(np.arange(len(q)), q)(rows)[: len(q)]


@pytest.mark.parametrize("what", ["speed", "acceleration", "position", "workspace", "collision"])
def test_a_broken_limit_is_named(arm, segments, space, what):
    far = space.home.copy()
    if what == "position":
        far[0] = ROBOT.upper[0] + 0.05
    elif what == "collision":
        far[1:3] = -0.1, 2.75  # the forearm folds into the upper arm
    else:
        far[0] += 0.8
    speed, acceleration = {"speed": (1.0, 0.3), "acceleration": (0.3, 1.0)}.get(what, (0.05, 0.01))
    if what == "workspace":
        at = forward_kinematics(arm, space.home[None])[0][0]
        space = space_of(arm, segments, workspace=(*(at - 0.05), *(at + 0.05)))
    broken = space.broken_limit(motion_of(space, (Move(far, speed, acceleration),)))
    assert broken is not None and broken.startswith(what)


def test_a_box_that_holds_the_arm_leaves_no_motion_and_is_refused(arm, segments):
    boxed = Scene(name="boxed", box=[{"name": "crate", "centre": (0.0, 0.0, 0.5), "size": (2.0, 2.0, 2.0)}])
    with pytest.raises(UserError, match=r"box 'crate'.* collide in scene boxed in all of \d+ measured"):
        space_of(arm, segments, scene=boxed)


def test_a_workspace_without_a_measured_position_is_refused(arm, segments):
    with pytest.raises(UserError, match="lies in the workspace"):
        space_of(arm, segments, workspace=(5.0, 5.0, 5.0, 6.0, 6.0, 6.0))


def test_a_robot_without_capsules_is_refused(segments):
    bare = ROBOT.model_copy(update={"joint": [j.model_copy(update={"capsules": []}) for j in ROBOT.joint]})
    with pytest.raises(UserError, match="capsules"):
        space_of(Arm(bare), segments)


def test_a_script_holds_every_position_once_in_turn(pieces, space):
    steps = (*pieces[0].steps, *pieces[1].steps)
    text = programs(ROBOT, Move(space.home, 0.05, 0.05), steps, "check it", "acqd_next")["program.script"]
    targets = [step.target for step in steps if isinstance(step, Move)]
    lines = [line for line in text.splitlines() if "movej" in line]
    written = [np.array([float(x) for x in line.split("[")[1].split("]")[0].split(",")]) for line in lines]
    moved = [space.home, *targets]
    moved = [b for a, b in itertools.pairwise(moved) if np.abs(a - b).max() > 1e-9]
    assert np.allclose(written[1:], moved, atol=1e-5)
    assert text.startswith("# check it") and text.rstrip().endswith("acqd_next()")


def test_a_seven_axis_arm_gets_a_snippet_with_shares_of_its_limits():
    steps = (Move(np.full(7, 0.3), 0.25, 0.5), Wait(1.0), Wait(0.5), Move(np.zeros(7), 0.25, 0.5))
    text = programs(IIWA, Move(np.zeros(7), 0.05, 0.05), steps, "check it", "acqd_next")["Program.java"]
    assert text.count("robot.move(ptp(") == 3
    assert "setJointVelocityRel(0.2500)" in text and "ThreadUtil.milliSleep(1500);" in text
