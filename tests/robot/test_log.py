"""Robots' logs: real ones of three robots, and broken ones."""

import numpy as np
import pyarrow.parquet
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acqd.errors import InputError
from acqd.robot import load_description
from acqd.robot.description import LogColumns
from acqd.robot.log import require_rising
from acqd.robot.log_reader import read_log
from tests.places import ROBOT_LOGS, needs_robot_logs

WITH_TORQUES = ("opti_traj_testing1", "opti_traj_testing2")


@needs_robot_logs
@pytest.mark.parametrize(
    ("robot", "pattern", "files", "channels"),
    [
        ("ur3e", "ur3e_rtde/*.csv", 1, {"qd", "current", "temperature"}),
        ("ur10e", "ur10e/*.csv", 21, {"qd", "current"}),
        ("kinova_gen3", "kinova_gen3/*.csv", 11, {"qd", "current", "temperature"}),
    ],
)
def test_real_logs_are_read(robot, pattern, files, channels):
    description = load_description(robot)
    paths = sorted(ROBOT_LOGS.glob(pattern))
    assert len(paths) == files
    for path in paths:
        log = read_log(path, description)
        assert log.q.shape == (len(log.time), description.axes)
        # the torque sensors of the Kinova were on in two recordings; elsewhere some or all columns hold zeros
        known = {name for name in ("qd", "tau", "current", "temperature") if getattr(log, name) is not None}
        assert known == channels | ({"tau"} if path.stem in WITH_TORQUES else set())
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
        (
            HEADER.replace("time", "when") + "\n0,0,0,0,0,0,0,0\n",
            "has 7 columns qN, but no time: expected ZeitInSec and",
        ),
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
    (tmp_path / "x.log").write_bytes(b"\xff\xff\x00\x01")
    for path, reason in ((tmp_path, "is a folder"), (tmp_path / "x.log", "cannot be read .no UTF-8 text")):
        with pytest.raises(InputError, match=reason):
            read_log(path, load_description("iiwa7_r800"))


@needs_robot_logs
@pytest.mark.parametrize(
    ("file", "rows", "idle_W"),
    [("ZhizhuoUp", 256, 26.2), ("nour427", 10, 35.8), ("porrasp8", 2590, 32.8)],
)
def test_rtde_texts_with_odd_line_ends_and_power_at_the_supply(file, rows, idle_W):
    log = read_log(ROBOT_LOGS / "ur_standstill" / f"{file}_robot_data.csv", load_description("ur3e"))
    assert log.q.shape == (rows, 6) and not log.note
    assert np.mean(log.power) == pytest.approx(idle_W, abs=0.1) and np.median(log.voltage) == pytest.approx(48, abs=1.5)


@needs_robot_logs
def test_garbled_rows_of_a_real_log_are_left_out_and_named():
    log = read_log(ROBOT_LOGS / "ur10e_later" / "session_b.csv", load_description("ur10e"))
    assert log.note.startswith("9 of 6106 rows garbled and left out: rows 2, 3, 4, 5, 6 and 4 more (time -0.1231 s")
    assert len(log.time) == 6097 == len(log.current) and (log.time[0], log.time[-1]) == (3047.693, 3112.149)
    assert np.diff(log.time).max() < 0.4 and np.abs(log.q).max() < 3.5 and np.abs(log.current).max() < 30


@needs_robot_logs
def test_a_real_parquet_log_with_power_at_the_supply(tmp_path):
    columns = LogColumns(
        format="csv", q="joint_position_{1}", qd="joint_velocity_{1}", current="motor_iq_{1}",
        bus_voltage="robot_voltage", bus_current="robot_current",
    )  # fmt: skip
    robot = load_description("ur10e").model_copy(update={"log": [columns]})
    path = ROBOT_LOGS / "voraus_cobot" / "test.parquet"  # four recordings, each of which begins at 0 s
    with pytest.raises(InputError, match=r"row 101: time goes back from 0.997 to 0.000 s .*one file per recording"):
        read_log(path, robot)
    table = pyarrow.parquet.read_table(path)
    first = int(np.flatnonzero(np.diff(table["time"].to_numpy()) < 0)[0]) + 1
    pyarrow.parquet.write_table(table.slice(0, first), tmp_path / "one.parquet")
    log = read_log(tmp_path / "one.parquet", robot)
    assert log.q.shape == (first, 6) and first > 90 and 5 < log.power.min() < log.power.max() < 200


STEP_S, ROWS = 0.01, 400


def moving(**changes):
    """time and q of an iiwa that waves; rows of `changes` are overwritten."""
    time = 1_600_000_000 + STEP_S * np.arange(ROWS)
    q = np.column_stack([0.5 * np.sin(time - time[0] + axis) for axis in range(7)])
    return time, q


def csv_of(path, time, q):
    rows = [",".join([f"{t:.3f}", *(f"{x:.6f}" for x in row)]) for t, row in zip(time, q, strict=True)]
    path.write_text("\n".join([HEADER, *rows, ""]))
    return path


@pytest.mark.parametrize("stamp", [1e300, -5.0, 0.0, 1.7e12, np.inf, np.nan])
@pytest.mark.parametrize("row", [0, 200, ROWS - 1])
def test_an_absurd_stamp_is_left_out_wherever_it_is(tmp_path, stamp, row):
    time, q = moving()
    kept = np.delete(time, row)
    time[row] = stamp
    log = read_log(csv_of(tmp_path / "x.csv", time, q), load_description("iiwa7_r800"))
    np.testing.assert_allclose(log.time, kept, atol=1e-3)
    assert f"1 of {ROWS} rows garbled and left out: row {row + 2} (time" in log.note


@pytest.mark.parametrize("angle", [1e9, -2.9, 1.4, np.nan])
def test_an_angle_that_no_joint_can_reach_so_fast_is_left_out(tmp_path, angle):
    time, q = moving()
    q[[100, 300], 3] = angle
    log = read_log(csv_of(tmp_path / "x.csv", time, q), load_description("iiwa7_r800"))
    assert len(log.time) == ROWS - 2 and "rows 102, 302 (" in log.note


def test_rows_without_angles_are_left_out_however_many_they_are(tmp_path):
    time, q = moving()
    kept = np.delete(np.arange(ROWS), np.concatenate([np.arange(50), np.arange(51, ROWS, 3)]))
    q[np.setdiff1d(np.arange(ROWS), kept), 2] = np.nan  # before the driver knew them, and of rows of another message
    log = read_log(csv_of(tmp_path / "x.csv", time, q), load_description("iiwa7_r800"))
    np.testing.assert_allclose(log.time, time[kept], atol=1e-6)
    assert "rows garbled and left out" in log.note


def test_many_garbled_rows_and_jumps_that_last_are_refused(tmp_path):
    time, q = moving()
    garbled = time.copy()
    garbled[::20] = 0
    with pytest.raises(InputError, match=r"row 2: time 0 s does not belong .*\(20 of 400 rows are garbled\)"):
        read_log(csv_of(tmp_path / "x.csv", garbled, q), load_description("iiwa7_r800"))
    q[200:, 2] += 1.5
    with pytest.raises(InputError, match=r"row 202: A3 turns \+86 deg in 0.010 s, its limit is 100 deg/s"):
        read_log(csv_of(tmp_path / "y.csv", time, q), load_description("iiwa7_r800"))


def test_pauses_short_recordings_and_rows_out_of_order_are_no_damage(tmp_path):
    time, q = moving()
    time += 300.0 * (np.arange(ROWS) // 20)  # twenty rows, then five minutes of nothing
    order = np.arange(ROWS)
    order[50:53] = [52, 50, 51]
    log = read_log(csv_of(tmp_path / "x.csv", time[order], q[order]), load_description("iiwa7_r800"))
    assert len(log.time) == ROWS and not log.note


def test_a_block_of_rows_that_came_late_is_no_other_recording(tmp_path):
    time, q = moving()
    order = np.concatenate([np.arange(100), np.arange(150, 200), np.arange(100, 150), np.arange(200, ROWS)])
    log = read_log(csv_of(tmp_path / "x.csv", time[order], q[order]), load_description("iiwa7_r800"))
    assert len(log.time) == ROWS and log.quality.fault is None


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, ROWS - 1), st.integers(0, 7), st.floats(width=32)), max_size=6))
@example([(0, 0, 0.0), (1, 1, np.inf), (2, 0, 0.0), (3, 0, 0.0), (4, 0, 0.0)])
def test_whatever_is_in_some_cells_the_log_is_read_or_refused(tmp_path_factory, cells):
    time, q = moving()
    values = np.column_stack([time, q])
    for row, column, value in cells:
        values[row, column] = value
    path = csv_of(tmp_path_factory.mktemp("x") / "x.csv", values[:, 0], values[:, 1:])
    try:
        log = read_log(path, load_description("iiwa7_r800"))
    except InputError as error:
        assert "row" in str(error) or "joint" in str(error) or "reaches" in str(error)
        return
    unmeasured = int((~np.isfinite(values[:, 1:])).any(axis=1).sum())  # left out beside one row in a hundred
    assert np.isfinite(log.q).all() and np.ptp(log.time) < 60 and len(log.time) >= ROWS - 4 - unmeasured


def test_small_angles_in_degrees_are_known_by_their_speeds(tmp_path):
    t = 0.01 * np.arange(600)
    q, qd = 0.05 * np.sin(2 * t)[:, None] * np.ones(6), 0.1 * np.cos(2 * t)[:, None] * np.ones(6)
    names = ["time", *(f"{name}{k + 1}" for name in ("q", "qd") for k in range(6))]
    path = tmp_path / "log.csv"
    for angles in (q, np.degrees(q)):
        np.savetxt(path, np.column_stack([t, angles, qd]), "%.9f", ",", header=",".join(names), comments="")
        if angles is q:
            assert read_log(path, load_description("ur10e")).qd is not None
    with pytest.raises(InputError, match="the angles are in degrees; write radians"):
        read_log(path, load_description("ur10e"))
