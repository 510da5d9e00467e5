"""Lags of real motion that is written with few digits: right, or within an interval that says so."""

from pathlib import Path

import numpy as np
import pytest

from acqd.dataset.placement import place
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import _apart, regressors_of
from acqd.robot.description import load_description
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import read_log
from tests.places import ROBOT_LOGS, needs_robot_logs

ROBOT = load_description("ur10e")
NAMES = ("ur-20_02_05-20sec_12harm", "ur-20_02_05-20sec_8harm", "ur-20_02_06-20sec_10harm")
AHEAD_S, WINDOW_S = 3.217, 0.04


@pytest.fixture(scope="module")
def recordings():
    """Times [s] from 0 and columns of three real logs, and the power [W] of their measured currents, on one clock."""
    start_s, clock, made = 0.0, np.arange(-20.0, 700.0, WINDOW_S), []
    power = np.full(len(clock), 36.0)
    for name in NAMES:
        log = read_log(ROBOT_LOGS / "ur10e" / f"{name}.csv", ROBOT)
        time = log.time - log.time[0]
        gain = np.array([joint.drive.effort_per_ampere for joint in ROBOT.joint])
        watts = 36 + (gain * log.current * log.qd).sum(axis=1) + (0.7 * log.current**2).sum(axis=1)
        energy = np.concatenate([[0.0], np.cumsum((watts[1:] + watts[:-1]) / 2 * np.diff(time))])
        inside = (clock >= start_s) & (clock + WINDOW_S <= start_s + time[-1])  # a meter averages over its window
        ends = (np.interp(clock[inside] + edge - start_s, time, energy) for edge in (WINDOW_S, 0.0))
        power[inside] = np.subtract(*ends) / WINDOW_S
        made.append((time + start_s + AHEAD_S, log.q))
        start_s += time[-1] + 100.0
    power += np.random.default_rng(0).normal(0, 0.2, len(clock))
    stamps = np.rint(1e9 * clock).astype(np.int64)
    return made, PowerStream(stamps, power, np.full(len(clock), np.nan), round(1e9 * WINDOW_S), 0, "simulated", "test")


def placed(recordings, folder, digits, time_digits):
    """Logs with so many digits, and where they are placed."""
    made, power = recordings
    logs = []
    for name, (time, q) in zip(NAMES, made, strict=True):
        columns = np.column_stack([np.floor(time * 10.0**time_digits) / 10.0**time_digits, q.round(digits)])
        path = folder / f"{name}.csv"
        np.savetxt(path, columns, "%.9f", ",", header="time,q1,q2,q3,q4,q5,q6", comments="")
        logs.append(read_log(path, ROBOT))
    regressors = [regressors_of(log, ROBOT) for log in logs]
    return logs, place(regressors, power, 10.0, lambda _: None, list(NAMES)).placements


@needs_robot_logs
@pytest.mark.parametrize(("digits", "time_digits"), [(3, 9), (2, 9), (9, 2)])
def test_the_lag_of_coarse_logs_is_the_true_one_in_its_interval(recordings, tmp_path, digits, time_digits):
    logs, placements = placed(recordings, tmp_path, digits, time_digits)
    assert all("only written to" in log.quality.sentences()[0] for log in logs)
    for placement in placements:
        assert placement.method != "refused"
        assert abs(placement.lag_s - AHEAD_S) < max(0.01, placement.within_s)
        assert placement.within_s < 0.045


def test_rows_of_a_packet_do_not_make_the_motion_swing(tmp_path):
    robot = load_description("ur10e")
    t = 0.01 * np.arange(2000)
    rest = np.abs(t - 10) > 5
    moved = np.where(rest, 0.0, 0.3 * (1 + np.cos(np.pi * (t - 10) / 5)))
    q = moved[:, None] + np.random.default_rng(0).normal(0, 1e-5, (2000, 6))
    packets = np.where(rest, t[np.arange(2000) // 10 * 10 + 9] + 1e-4 * (np.arange(2000) % 10), t)
    columns = regressors_of(RobotLog(tmp_path / "log.csv", packets, q), robot).columns
    even = regressors_of(RobotLog(tmp_path / "log.csv", t, q), robot).columns
    assert np.abs(columns).max(axis=0) == pytest.approx(np.abs(even).max(axis=0), rel=0.5, abs=0.1)


def test_rows_that_are_dense_in_motion_only_keep_the_motion():
    moving, resting = np.arange(0, 2, 0.001), np.arange(2, 42, 0.25)
    time = np.concatenate([moving, resting, 42 + moving])
    apart, values = _apart(time, np.sin(time)[:, None])
    assert (apart < 2).sum() > 150 and np.abs(values[:, 0] - np.sin(apart)).max() < 1e-3


def held_log(step_s, longest_s):
    """An arm that moves, without the rows of `longest_s` in every second."""
    t = np.arange(0.0, 12.0, step_s)
    kept = (t % 1.0 == 0) | (t % 1.0 >= longest_s)
    q = np.column_stack([np.sin((1 + 0.1 * k) * t) for k in range(6)])
    return RobotLog(Path("log.csv"), t[kept], q[kept])


def test_motion_across_rows_that_are_far_apart_is_not_known():
    known = regressors_of(held_log(0.01, 0.2), ROBOT).known
    assert known is not None and 0.5 < known.mean() < 0.7


def test_motion_between_seldom_rows_is_known():
    assert regressors_of(held_log(0.12, 0.0), ROBOT).known is None
