"""Lags of real motion that is written with few digits: right, or within an interval that says so."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from acqd.dataset.placement import place
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import regressors_of
from acqd.robot.description import load_description
from acqd.robot.log import read_log
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
        current = gaussian_filter1d(log.current, 2, axis=0)
        gain = np.array([joint.drive.effort_per_ampere for joint in ROBOT.joint])
        watts = 36 + (gain * current * log.qd).sum(axis=1) + (0.7 * current**2).sum(axis=1)
        inside = (clock + WINDOW_S / 2 >= start_s) & (clock + WINDOW_S / 2 <= start_s + time[-1])
        power[inside] = np.interp(clock[inside] + WINDOW_S / 2 - start_s, time, watts)
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


@pytest.fixture(scope="module")
def fine(recordings, tmp_path_factory):
    """Lags [s] of the logs as they were recorded."""
    _, placements = placed(recordings, tmp_path_factory.mktemp("fine"), 9, 9)
    return [placement.lag_s for placement in placements]


@needs_robot_logs
@pytest.mark.parametrize(("digits", "time_digits"), [(3, 9), (2, 9), (9, 2)])
def test_coarse_logs_have_the_lag_of_fine_ones_within_its_interval(recordings, fine, tmp_path, digits, time_digits):
    logs, placements = placed(recordings, tmp_path, digits, time_digits)
    assert all("only written to" in log.quality.sentences()[0] for log in logs)
    for placement, right_s in zip(placements, fine, strict=True):
        assert placement.method != "refused"
        assert abs(placement.lag_s - right_s) < max(0.01, placement.within_s)
        assert placement.within_s < 0.045
