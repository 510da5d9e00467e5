"""Robots' logs: real ones of three robots, and broken ones."""

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.robot import load_description
from acqd.robot.log import read_log, require_rising
from tests.places import ROBOT_LOGS, needs_robot_logs


@needs_robot_logs
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
    paths = sorted(ROBOT_LOGS.glob(pattern))
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


@needs_robot_logs
def test_a_log_of_another_robot_is_refused():
    path = ROBOT_LOGS / "kinova_gen3" / "joint_1_trapez.csv"
    with pytest.raises(InputError, match="has none of the columns a log of ur3e has"):
        read_log(path, load_description("ur3e"))


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
