"""Logs, bags and URDFs that were misread, refused without the remedy, or ended in a traceback."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from acqd.errors import InputError
from acqd.robot.arm import Arm
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.dynamics import inverse_dynamics
from acqd.robot.log_reader import read_log
from acqd.robot.plausibility import implausible
from acqd.robot.urdf.describe import describe_urdf
from tests.places import COMPLAINTS, needs_complaints

pytestmark = needs_complaints
UR10E = load_description("ur10e")


def torques(name):
    robot = RobotDescription.model_validate(describe_urdf(COMPLAINTS / name).table)
    q = np.random.default_rng(0).uniform(-2, 2, (50, 6))
    return inverse_dynamics(Arm(robot), q, 0.3 * q, 0.7 * q)


def test_quaternions_of_urdf_1_1_turn_frames_as_roll_pitch_and_yaw_do():
    np.testing.assert_allclose(torques("urdf11_quaternions.urdf"), torques("urdf11_same_arm_in_rpy.urdf"), atol=1e-6)


def test_a_urdf_in_another_encoding_is_read_and_an_unknown_one_is_named():
    assert len(describe_urdf(COMPLAINTS / "urdf_gb2312.urdf").robot.joint) == 6
    with pytest.raises(InputError, match="save the file as UTF-8"):
        describe_urdf(COMPLAINTS / "urdf_unknown_encoding.urdf")


def test_limits_in_degrees_are_doubted():
    made = describe_urdf(COMPLAINTS / "urdf_limits_in_degrees.urdf")
    assert any("are these degrees?" in note for note in made.notes)
    assert any("limits_deg" in finding.where for finding in implausible(made.robot))


@pytest.mark.parametrize("name", ["log_comment_lines", "log_iso_times", "log_numpy_savetxt_header"])
def test_comments_headers_behind_a_mark_and_times_with_a_date_are_read(name):
    log = read_log(COMPLAINTS / f"{name}.csv", UR10E)
    assert log.q.shape == (500, 6)
    assert log.time[0] == pytest.approx(1769500000.0, abs=1e-6)
    np.testing.assert_allclose(np.diff(log.time), 0.04, atol=1e-6)


def test_the_log_of_libfranka_is_the_log_of_its_arm():
    log = read_log(COMPLAINTS / "log_libfranka_0x.csv", load_description("franka_panda"))
    assert log.q.shape == (500, 7)
    np.testing.assert_allclose(np.diff(log.time), 0.04, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("log_list_in_quotes.csv", "a cell holds a list"),
        ("bag_arm_in_two_messages", "the joints of one arm come in several messages"),
        ("bag_not_closed.mcap", "mcap recover"),
    ],
)
def test_a_refusal_names_the_remedy(name, remedy):
    with pytest.raises(InputError, match=remedy):
        read_log(COMPLAINTS / name, UR10E)


def test_parquet_with_text_decimals_and_lists_is_read(tmp_path):
    t = np.arange(100) * 0.04
    columns = {"time": pa.array([f"{each:.2f}" for each in t])}
    columns |= {f"q{k + 1}": pa.array(np.sin(t).round(6)).cast(pa.decimal128(20, 6)) for k in range(6)}
    pyarrow.parquet.write_table(pa.table(columns), tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet", UR10E)
    np.testing.assert_allclose(log.q[:, 0], np.sin(t), atol=1e-6)
    np.testing.assert_allclose(log.time, t, atol=1e-9)
    angles = [[value, *range(5)] for value in np.sin(t).round(6).tolist()]
    for name, time in (("actual_q", "timestamp"), ("q", "time")):
        lists = {time: t, name: angles, "image": [[0.5] * 90] * 100, "boxes": [[1.0] * (k % 3) for k in range(100)]}
        pyarrow.parquet.write_table(pa.table(lists), tmp_path / "lists.parquet")
        np.testing.assert_array_equal(read_log(tmp_path / "lists.parquet", UR10E).q, angles)
