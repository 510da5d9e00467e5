"""How finely positions and times are written, and positions smoothed by as much as that requires."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.robot.description import load_description
from acqd.robot.doubtful_rows import doubtful_rows
from acqd.robot.log_reader import read_log
from acqd.robot.resolution import resolution, smoothed, smoothing_of
from tests.places import ROBOT_LOGS, needs_robot_logs

ROBOT = load_description("ur10e")


@given(digits=st.integers(1, 5), seed=st.integers(0, 99))
def test_the_step_of_written_numbers_is_that_of_their_last_digit(digits, seed):
    t = np.arange(0, 20, 0.01)
    values = np.sin(t + seed) + 0.3 * np.sin(3.7 * t)
    assert resolution(values.round(digits)) == pytest.approx(10.0**-digits, rel=1e-6)
    assert resolution(np.radians(np.degrees(values).round(digits))) == pytest.approx(np.radians(10.0**-digits))
    assert resolution(values) == 0.0
    assert resolution(0.31831 + 0.0081237 * np.arange(200)) < 1e-5  # constant speed


def test_rest_at_a_round_angle_shows_no_step():
    t = np.arange(0, 20, 0.01)
    values = np.where(t < 8, 0.0, 0.4 * np.sin(0.7 * (t - 8)) + 0.2 * np.sin(1.9 * (t - 8)))
    assert resolution(values.round(2)) == pytest.approx(0.01)
    assert resolution(values) == 0.0


def test_three_digits_of_millimetres_are_a_step_of_one_millimetre():
    values = 150 + 45 * np.sin(np.arange(0, 100, 0.1) / 9)
    assert resolution(np.array([float(f"{each:.3g}") for each in values])) == pytest.approx(1.0)


def test_slow_motion_in_coarse_steps_repeats_no_pose():
    t = np.arange(0, 60, 0.1)
    x = 0.15 + 0.04 * np.sin(0.15 * t)  # 6 mm/s, written in steps of 1 mm
    q = np.column_stack([x, 0.12 + 0.03 * np.cos(0.13 * t)]).round(3)
    step = np.array([resolution(axis) for axis in q.T])
    assert not doubtful_rows(t, q, np.array([0.1, 0.1]), step).any.any()


def real():
    log = read_log(ROBOT_LOGS / "ur10e" / "ur-20_02_06-20sec_5harm.csv", ROBOT)
    return log.time - log.time[0], log.q


@needs_robot_logs
def test_a_fine_log_stays_as_it_was_logged():
    t, q = real()
    assert smoothing_of(t, q, np.array([resolution(axis) for axis in q.T]), ROBOT.speed) is None


@needs_robot_logs
@pytest.mark.parametrize(("digits", "named"), [(3, "written to 0.001"), (2, "written to 0.01 ")])
def test_coarse_positions_are_smoothed_near_the_true_ones_also_at_the_ends(digits, named):
    t, q = real()
    coarse = q.round(digits)
    smoothing = smoothing_of(t, coarse, np.array([resolution(axis) for axis in coarse.T]), ROBOT.speed)
    assert named in smoothing.sentence()
    better = smoothed(t, coarse, smoothing.windows_s)
    moving = np.abs(np.gradient(q, axis=0)) > 10.0**-digits / 20  # where a joint rests, no row tells more
    assert (better - q)[moving].std() < 0.6 * (coarse - q)[moving].std()
    assert np.abs(better - q).max() < 1.5 * 10.0**-digits


@needs_robot_logs
def test_times_that_are_cut_off_are_known_by_the_way_between_rows():
    t, q = real()
    cut = np.floor(100 * t + 1e-6) / 100
    rows = np.unique(cut, return_index=True)[1]
    step = np.array([resolution(axis) for axis in q.T])
    smoothing = smoothing_of(cut[rows], q[rows], step, ROBOT.speed)
    assert 0.001 < smoothing.jitter_s < 0.006
    assert "times are only written to 0.01 s" in smoothing.sentence()
    # missing rows are no wrong times
    some = np.random.default_rng(1).random(len(t)) > 0.15
    assert smoothing_of(t[some], q[some], step, ROBOT.speed) is None


def test_angles_of_an_integrator_are_no_counts_of_an_encoder():
    speed = np.cumsum(np.repeat(np.tile([1, 0, -1, 0, -1, 0, 1, 0], 4), 12)) * 2.4567891 / 25
    assert resolution(0.3 + np.cumsum(speed) / 25) == 0.0
