"""Rows of a motion that cannot be trusted: repeated, old and early poses, wrapped angles."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from acqd.robot.description import load_description
from acqd.robot.doubtful_rows import bridged, doubtful_rows
from acqd.robot.log_reader import read_log
from acqd.robot.unwrapping import unwrapped
from tests.places import COMPLAINTS, ROBOT_LOGS, needs_complaints, needs_robot_logs

ROBOT = load_description("ur10e")
RECORDING = ROBOT_LOGS / "ur10e" / "ur-20_02_06-20sec_5harm.csv"


def real():
    """Times and angles of a real UR10e, without a fault."""
    log = read_log(RECORDING, ROBOT)
    return log.time, log.q


def older(t, q, rows, age_s):
    """Angles whose poses in `rows` are `age_s` old."""
    return np.column_stack([np.interp(t - age_s * rows, t, angle) for angle in q.T])


@needs_robot_logs
def test_a_real_log_without_faults_has_no_doubtful_rows():
    t, q = real()
    assert not doubtful_rows(t, q, ROBOT.speed).any.any()


@needs_robot_logs
@pytest.mark.parametrize("share", [0.01, 0.05, 0.1])
def test_rows_that_repeat_the_pose_before_are_counted_and_no_others(share):
    t, q = real()
    wrong = np.random.default_rng(1).random(len(t)) < share
    wrong[0] = False
    doubts = doubtful_rows(t, q[np.arange(len(t)) - wrong], ROBOT.speed)
    assert (doubts.any & ~wrong).sum() <= 0.02 * wrong.sum()
    quality = doubts.quality()
    assert share / 1.3 < quality.bad_share < 1.3 * share  # of the rows in motion


@needs_robot_logs
@pytest.mark.parametrize("rows_late", [0.5, 1.0, 2.0, 3.0])
def test_poses_older_than_their_stamp_are_found_with_their_age(rows_late):
    t, q = real()
    wrong = np.random.default_rng(2).random(len(t)) < 0.03
    doubts = doubtful_rows(t, older(t, q, wrong, 0.01 * rows_late), ROBOT.speed)
    assert (doubts.any & ~wrong).sum() <= 2
    assert 0.03 / 1.5 < doubts.quality().bad_share < 1.5 * 0.03
    assert doubts.age_s == pytest.approx(0.01 * rows_late, abs=0.003)


@needs_robot_logs
@pytest.mark.parametrize("rows_ahead", [1, 2])
def test_poses_that_are_read_ahead_and_then_again_are_early_and_their_neighbours_are_right(rows_ahead):
    t, q = real()
    wrong = np.random.default_rng(3).random(len(t)) < 0.02
    doubts = doubtful_rows(t, q[np.minimum(np.arange(len(t)) + rows_ahead * wrong, len(t) - 1)], ROBOT.speed)
    assert (doubts.any & ~wrong).sum() <= 0.25 * wrong.sum()
    assert 0.02 / 1.5 < doubts.quality().bad_share < 1.5 * 0.02
    assert doubts.early.sum() > 3 * doubts.old.sum()


@needs_robot_logs
def test_messages_that_overtake_each_other_are_early_and_old():
    t, q = real()
    first = np.flatnonzero(np.random.default_rng(4).random(len(t) - 1) < 0.01)
    order = np.arange(len(t))
    order[first], order[first + 1] = first + 1, first
    wrong = order != np.arange(len(t))
    doubts = doubtful_rows(t, q[order], ROBOT.speed)
    assert (doubts.any & ~wrong).sum() <= 0.15 * wrong.sum()
    assert 0.02 / 1.5 < doubts.quality().bad_share < 1.5 * 0.02


@needs_robot_logs
@pytest.mark.parametrize("times", [2, 4, 10])
def test_a_recorder_that_is_faster_than_the_controller_keeps_each_pose_once(times):
    t, q = real()
    doubts = doubtful_rows(t, q[np.arange(len(t)) // times * times], ROBOT.speed)
    quality = doubts.quality()
    assert quality.repeated / quality.moving == pytest.approx(1 - 1 / times, abs=0.02)
    assert quality.age_error_s == pytest.approx(0.01, rel=0.2)
    assert "record them at that rate" in quality.sentences()[0]


@needs_robot_logs
def test_a_controller_that_is_not_synchronised_with_the_recorder_is_no_fault():
    t, q = real()
    held = np.floor((t - t[0]) / 0.008) * 0.008 + t[0]
    assert doubtful_rows(t, older(t, q, t - held, 1.0), ROBOT.speed).quality().bad_share < 0.002


@settings(max_examples=30, deadline=None)
@given(rest_s=st.floats(0.1, 3.0), acceleration=st.floats(0.5, 8.0), step_s=st.sampled_from([0.004, 0.01, 0.04]))
def test_an_arm_that_rests_between_motions_repeats_no_pose(rest_s, acceleration, step_s):
    """A rest of fewer than five rows may look like a recorder that repeats a row."""
    assume(rest_s >= 5 * step_s)
    t = np.arange(0, 4 + rest_s, step_s)
    ramp = np.clip(np.minimum(t - 0.313, 2 - t) * acceleration, 0, 1.5)
    again = np.clip(np.minimum(t - 2 - rest_s, 4 + rest_s - t) * acceleration, 0, 1.5)
    angle = np.cumsum(ramp - again) * step_s
    q = np.round(np.column_stack([angle, 0.3 * angle, *[np.zeros(len(t))] * 4]), 5)
    assert not doubtful_rows(t, q, ROBOT.speed).any.any()


@given(turns=st.integers(-3, 3), start=st.floats(-6, 6), speed=st.floats(-2, 2))
def test_wrapped_angles_are_unwrapped_and_others_stay(turns, start, speed):
    t = np.arange(0, 6, 0.02)
    true = np.column_stack([start + speed * t, np.sin(t)])
    logged = true.copy()
    logged[:, 0] = (true[:, 0] + np.pi) % (2 * np.pi) - np.pi
    logged[150:, 1] += 2 * np.pi * turns  # a revolution counter that is reset
    mended = unwrapped(logged, np.full((len(t) - 1, 2), 0.2), np.array([True, True]))
    np.testing.assert_allclose(np.diff(mended, axis=0), np.diff(true, axis=0), atol=1e-9)
    slides = unwrapped(logged, np.full((len(t) - 1, 2), 0.2), np.array([False, False]))
    np.testing.assert_array_equal(slides, logged)


def test_doubtful_rows_are_bridged_by_a_cubic_and_long_runs_stay_unknown():
    t = np.arange(0, 2, 0.04)
    values = np.column_stack([t**3 - t, np.cos(t)])
    doubts = np.zeros(len(t), bool)
    doubts[[10, 20, 21]] = True
    doubts[30:40] = True
    filled, unknown = bridged(t, np.where(doubts[:, None], 9.0, values), doubts, 0.25)
    np.testing.assert_allclose(filled[~unknown], values[~unknown], atol=1e-5)
    assert np.flatnonzero(unknown).tolist() == list(range(30, 40))


@needs_complaints
def test_a_continuous_joint_that_wraps_reads_as_the_joint_that_does_not():
    robot = load_description("kinova_gen3")
    wraps, plain = (read_log(COMPLAINTS / f"log_continuous_joint_{name}.csv", robot) for name in ("wraps", "unwrapped"))
    np.testing.assert_allclose(np.diff(wraps.q, axis=0), np.diff(plain.q, axis=0), atol=1e-6)
    assert "joint_3" in wraps.quality.unwrapped and plain.quality.unwrapped == ()


@needs_robot_logs
@pytest.mark.parametrize("name", ["tau", "current"])
def test_a_quantity_of_zeros_while_the_arm_moves_is_not_measured(tmp_path, name):
    t, q = real()
    columns = {"time": t} | {f"q{k + 1}": q[:, k] for k in range(6)} | {f"{name}{k + 1}": 0 * t for k in range(6)}
    np.savetxt(tmp_path / "log.csv", np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns),
               comments="")  # fmt: skip
    log = read_log(tmp_path / "log.csv", ROBOT)
    assert getattr(log, name) is None
    assert "of every joint never changes while the arm moves" in log.quality.sentences()[0]


def test_a_pause_of_the_recorder_after_a_rest_repeats_no_pose():
    """While nothing was written, the arm has left its rest."""
    t = np.arange(0, 5, 0.01)
    share = np.clip(t - np.array([[0.9], [2.1]]), 0, 1)
    q = (10 * share**3 - 15 * share**4 + 6 * share**5).sum(axis=0)[:, None] * np.linspace(0.5, 1.0, 6)
    kept = (t < 2.105) | (t > 2.9)
    assert not doubtful_rows(t[kept], q[kept], ROBOT.speed).any.any()


def test_a_slow_axis_with_more_noise_than_the_others_holds_no_old_poses():
    """The column of a SCARA: by its speed limit, its angle is noisier, and shows where it moves alone."""
    t = np.arange(0, 30, 0.004)
    both = t % 10 < 8
    turns, column = np.where(both, 1 - np.cos(np.pi * t), 0.0), np.where(both, 0.0, 0.05 * (1 - np.cos(np.pi * t)))
    q = np.column_stack([turns, 0.8 * turns, column]) + np.random.default_rng(3).normal(0, 3e-5, (len(t), 3))
    assert doubtful_rows(t, q, np.array([5.0, 7.0, 1.0])).any.sum() <= 2
