"""Logs: real ones of three robots, the virtual controller's own, and broken ones."""

from pathlib import Path

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.lab.instruments.data_recorder import ControllerClock, Recorded, RecorderSettings, record
from acqd.robot import load_description
from acqd.robot.log import read_log, require_rising

DATA = Path(__file__).parents[2] / "shared" / "data" / "robots"


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is not there")
@pytest.mark.parametrize(
    ("robot", "pattern", "files", "channels"),
    [
        ("ur3e", "ur3e_rtde/*.csv", 1, {"qd", "current", "temperature"}),
        ("ur10e", "ur10e/*.csv", 21, {"qd", "current"}),
        ("kinova_gen3", "kinova_gen3/*.csv", 11, {"qd", "tau", "current", "temperature"}),
    ],
)
def test_real_logs_are_read(robot, pattern, files, channels):
    description = load_description(robot)
    paths = sorted(DATA.glob(pattern))
    assert len(paths) == files
    for path in paths:
        log = read_log(path, description)
        assert log.q.shape == (len(log.time), description.axes)
        assert {name for name in ("qd", "tau", "current", "temperature") if getattr(log, name) is not None} == channels
        require_rising(log)
        # the logged speed is the derivative of the logged angle: columns and units are the right ones
        slope = np.gradient(log.q, log.time, axis=0)
        moving = np.abs(log.qd) > 0.1
        assert np.median(slope[moving] / log.qd[moving]) == pytest.approx(1.0, abs=0.02)


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is not there")
def test_a_log_of_another_robot_is_refused():
    path = DATA / "kinova_gen3" / "joint_1_trapez.csv"
    with pytest.raises(InputError, match="has none of the columns a log of ur3e has"):
        read_log(path, load_description("ur3e"))


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
    settings = RecorderSettings(jitter_s=0.0, angle_noise_rad=0.0, torque_noise_Nm=0.0)
    rows = record(path, robot, seen, 1000.0, clock, settings, np.random.default_rng(0))
    log = read_log(path, robot)
    assert rows == len(log.time) == 100
    expected = 1_600_000_000 + 1000 * (1 + 40e-6) + 3.5 + np.arange(100) * 0.04 * (1 + 40e-6)
    np.testing.assert_allclose(log.time, expected, atol=1.1e-3)  # DataRecorder: whole milliseconds
    np.testing.assert_allclose(log.q, seen.q[::40], atol=1e-6)
    np.testing.assert_array_equal(log.signals["tool"], seen.tool_on[::40])
    np.testing.assert_array_equal(log.signals["brake"], seen.brake_open[::40])
    assert (log.tau is not None) == (name == "iiwa7_r800")
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


HEADER = "time," + ",".join(f"q{k}" for k in range(1, 8))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "is empty"),
        (HEADER + "\n", "has no rows of numbers"),
        (HEADER + "\n0,0,0,0,0,0,0,0\n1,0,0,0\n", "row 3 has 4 columns, the first line 8; is it cut off"),
        (HEADER + "\n0,0,0,0,0,0,0,0\n1,0,0,x,0,0,0,0\n", "row 3: q column 3 is empty or no number"),
        (HEADER.replace(",q7", "") + "\n0,0,0,0,0,0,0\n", "has 6 columns qN, but iiwa7_r800 has 7 axes"),
        (HEADER.replace("time", "when") + "\n0,0,0,0,0,0,0,0\n", "has none of the columns a log of iiwa7_r800 has"),
        (HEADER + "\n0,90,0,0,0,0,0,0\n1,91,0,0,0,0,0,0\n", "A1 reaches 91 rad.*look like degrees: write radians"),
        (HEADER + "\n0,0,2.5,0,0,0,0,0\n", "A2 reaches 2.5 rad, but its limit is 120 deg; is this a log of iiwa7"),
        ("1,2,3\n4,5,6\n", "has no header and 3 columns; expected a header time,q1..q7"),
    ],
)
def test_a_broken_log_is_named_where_it_is_broken(tmp_path, text, complaint):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        read_log(path, load_description("iiwa7_r800"))


def test_a_clock_that_goes_back_is_named(tmp_path):
    path = tmp_path / "back.csv"
    path.write_text(HEADER + "\n" + "".join(f"{t},0,0,0,0,0,0,0\n" for t in (0, 1, 0.5, 2)))
    with pytest.raises(InputError, match=r"time goes from 1\.000000 s to 0\.500000 s at data row 3"):
        require_rising(read_log(path, load_description("iiwa7_r800")))


def test_a_directory_and_binary_files_are_no_logs(tmp_path):
    (tmp_path / "x.log").write_bytes(b"\xff\xfe\x00\x01")
    for path, reason in ((tmp_path, "Is a directory"), (tmp_path / "x.log", "no UTF-8 text")):
        with pytest.raises(InputError, match=f"cannot be read .{reason}"):
            read_log(path, load_description("iiwa7_r800"))
