"""The virtual controller's logs."""

import numpy as np
import pytest

from acqd.lab.instruments.data_recorder import ControllerClock, Recorded, RecorderSettings, record
from acqd.robot import load_description
from acqd.robot.log import require_rising
from acqd.robot.log_reader import read_log


def motion(axes, seconds=4.0):
    t = np.arange(0, seconds, 1e-3)
    q = 0.8 * np.sin(t[:, None] * 0.9 + np.arange(axes))
    return Recorded(q, 10 * q, 0.5 * q, 30 + 0 * q, (t > 2).astype(float), (t > 1).astype(float))


@pytest.mark.parametrize(("name", "suffix"), [("iiwa7_r800", ".log"), ("ur10e", ".csv")])
def test_what_the_controller_records_is_what_is_read(tmp_path, name, suffix):
    robot = load_description(name)
    seen = motion(robot.axes)
    path = tmp_path / f"one{suffix}"
    clock = ControllerClock(offset_s=3.5, drift_ppm=40.0, origin_utc_ns=1_600_000_000_000_000_000)
    settings = RecorderSettings(jitter_s=0.0, angle_noise_rad=0.0, torque_noise_Nm=0.0, torque_scale=1.02)
    rows = record(path, robot, seen, 1000.0, clock, settings, np.random.default_rng(0))
    log = read_log(path, robot)
    assert rows == len(log.time) == 100
    expected = 1_600_000_000 + 1000 * (1 + 40e-6) + 3.5 + np.arange(100) * 0.04 * (1 + 40e-6)
    np.testing.assert_allclose(log.time, expected, atol=1.1e-3)  # DataRecorder: whole milliseconds
    np.testing.assert_allclose(log.q, seen.q[::40], atol=1e-6)
    np.testing.assert_array_equal(log.signals["tool"], seen.tool_on[::40])
    np.testing.assert_array_equal(log.signals["brake"], seen.brake_open[::40])
    assert (log.tau is not None) == (name == "iiwa7_r800")
    if log.tau is not None:
        np.testing.assert_allclose(log.tau, 1.02 * seen.tau[::40], atol=1e-5)
    assert (log.current is not None) == (name == "ur10e")


def test_rows_go_missing_and_signals_are_left_out_on_request(tmp_path):
    robot = load_description("iiwa7_r800")
    settings = RecorderSettings(missing=0.3, signals=False, period_s=0.004)
    rows = record(tmp_path / "x.log", robot, motion(7), 0.0, ControllerClock(), settings, np.random.default_rng(0))
    log = read_log(tmp_path / "x.log", robot)
    assert 600 < rows < 800 and log.signals == {}
    require_rising(log)


@pytest.mark.parametrize("period", [0.001, 0.002, 0.004])
def test_a_fast_recorders_clock_never_stands_still(tmp_path, period):
    robot = load_description("iiwa7_r800")
    settings = RecorderSettings(period_s=period)
    record(tmp_path / "x.log", robot, motion(7), 0.0, ControllerClock(), settings, np.random.default_rng(0))
    log = read_log(tmp_path / "x.log", robot)
    require_rising(log)
    assert len(log.time) == pytest.approx(4.0 / period, abs=2)
