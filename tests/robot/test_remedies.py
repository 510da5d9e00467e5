"""Files that are no table or no URDF, or nearly one: read, or refused with the remedy."""

import gzip

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.robot.description import LogColumns, RobotDescription, load_description
from acqd.robot.log_reader import read_log
from acqd.robot.plausibility import implausible
from acqd.robot.urdf.describe import describe_urdf

ROBOT = load_description("ur10e")
T = np.arange(200) * 0.02
HEADER = "time,q1,q2,q3,q4,q5,q6\n"
ROWS = "".join(f"{t:.3f},{np.sin(t):.6f},0.1,0.2,0.3,0.4,0.5\n" for t in T)
JOINTS = next(layout.joints for layout in ROBOT.log if layout.joints)


@pytest.mark.parametrize(
    "text",
    [
        HEADER + ROWS,
        "Recording of the arm, today\n" + HEADER + ROWS,
        "sep=,\n" + HEADER + ROWS,
        HEADER + ROWS.replace("\n", ",\n"),
        (HEADER + ROWS).encode("utf-16"),
        (HEADER + ROWS).replace(",", "|"),
        "\u200b" + HEADER + ROWS.replace("-", "\u2212"),
        HEADER + "".join(f"{t:.3f},{np.sin(t):.9E},0.1,0.2,0.3,0.4,0.5\n".replace("E", "D") for t in T),
    ],
)
def test_titles_separators_at_line_ends_and_utf_16_are_read(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    log = read_log(path, ROBOT)
    np.testing.assert_allclose(log.time, T, atol=1e-9)
    np.testing.assert_allclose(log.q[:, 0], np.sin(T), atol=1e-5)


@pytest.mark.parametrize(
    ("content", "remedy"),
    [
        (gzip.compress(ROWS.encode()), "gunzip"),
        (b"PK\x03\x04" + b"x" * 100, "write its table as CSV"),
        (b"version https://git-lfs.github.com/spec/v1\noid", "git lfs pull"),
        (b"<!DOCTYPE html><html>", "download the file itself"),
        (b'{"time": 0.0, "q1": 0.1}\n' * 200, "is JSON; write its table as CSV"),
        (b'[{"time": 0.0, "q1": 0.1},\n' * 200, "is JSON"),
        ((HEADER + ROWS + ROWS.replace(",0.1,", ",1.4,")).encode(), "row 202: .* one file per recording"),
        (HEADER.replace("q", "Q").encode() + ROWS.encode(), "in small letters, without units"),
        ((HEADER + ROWS.splitlines()[0]).encode(), "has one row of numbers"),
        (b"time,q0,q1,q2,q3,q4,q5\n" + ROWS.encode(), "counts its axes from 0"),
        (("time,A1,A2,A3,A4,A5,A6\n" + ROWS).encode(), r'if 6 numbered columns .* angles = "deg" for degrees'),
        (
            (HEADER + "".join(f"{t:.2f},{60 * np.sin(6 * t):.4f},1,1,1,1,1\n" for t in T)).encode(),
            'look like degrees: write radians, or angles = "deg"',
        ),
        ((HEADER + "08:15:00.1,0,0,0,0,0,0\n" * 200).encode(), "its times are neither numbers nor dates"),
        ((HEADER + "[2026-01-27 08:15:00.1],0,0,0,0,0,0\n" * 200).encode(), "its times are neither numbers nor dates"),
        (b"time,name,value\n0,q1,0.1\n0,q2,0.2\n", "has one value in each row; .* pivot the table first"),
        (
            ("".join(f"1,{k},base,pan,elbow,0.1,0.2,0.3,0.4,0.5,0.6,0.7\n" for k in range(9))).encode(),
            "expected a header",
        ),
        (
            (HEADER + "".join(f"{k},{row}\n" for k, row in enumerate(ROWS.splitlines()))).encode(),
            "row 2 has 8 columns, the first line 7; is a column without a name",
        ),
        (("Version\t2\nDate\ttoday\n***End***\n" + ROWS.replace(",", "\t")).encode(), "names of 7 columns before"),
        (
            ("__time," + ",".join(f"/js/{name}/position" for name in JOINTS) + "\n" + ROWS).encode(),
            r'but with \{joint\} for the name of the joint and joints = \["shoulder_pan_joint"',
        ),
        ((HEADER + "".join(f"{1769500000 + t:.3f}000,0,0,0,0,0,0\n".replace(".", "") for t in T)).encode(), "in us"),
    ],
)
def test_what_is_no_log_is_refused_with_the_remedy(tmp_path, content, remedy):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=remedy):
        read_log(path, ROBOT)


def test_a_layout_says_that_its_angles_are_degrees(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(
        "IPOC," + ",".join(f"AIPos.A{k},V{k}" for k in range(1, 7)) + "\n"
        + "".join(f"{1000 * t:.0f}" + f",{60 * np.sin(t):.5f},{60 * np.cos(t):.5f}" * 6 + "\n" for t in T)
    )  # fmt: skip
    layout = LogColumns(format="csv", time="IPOC", time_unit_s=0.001, q="AIPos.A{1}", qd="V{1}", angles="deg")
    log = read_log(path, ROBOT.model_copy(update={"log": [layout]}))
    np.testing.assert_allclose(log.q[:, 3], np.radians(60 * np.sin(T)), atol=1e-6)
    np.testing.assert_allclose(log.qd[:, 3], np.radians(60 * np.cos(T)), atol=1e-6)


def test_a_layout_names_columns_by_the_joints_and_a_first_one_with_the_mark_of_a_comment(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("%time," + ",".join(f"/js/{name}/position" for name in reversed(JOINTS)) + "\n" + ROWS)
    layout = LogColumns(format="csv", time="%time", q="/js/{joint}/position", joints=JOINTS)
    log = read_log(path, ROBOT.model_copy(update={"log": [layout]}))
    np.testing.assert_allclose(log.q[0], [0.5, 0.4, 0.3, 0.2, 0.1, 0.0])


@pytest.mark.parametrize("pattern", ["q{2}", "{name}", "{", "{joint.x}"])
def test_a_name_with_other_braces_is_refused(pattern):
    with pytest.raises(ValueError, match=r"expected \{0\}, \{1\} or \{joint\}"):
        LogColumns(format="csv", q=pattern)


@pytest.mark.parametrize(("on", "off"), [("True", "False"), ("ON", "off"), ("yes", "no")])
def test_a_signal_may_be_written_in_words(tmp_path, on, off):
    path = tmp_path / "log.csv"
    rows = (f"{row},{on if k % 90 < 45 else off}\n" for k, row in enumerate(ROWS.splitlines()))
    path.write_text(HEADER.replace("\n", ",tool\n") + "".join(rows))
    np.testing.assert_array_equal(read_log(path, ROBOT).signals["tool"], np.arange(len(T)) % 90 < 45)


def test_other_words_of_a_signal_are_said(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(HEADER.replace("\n", ",brake\n") + ROWS.replace("\n", ",released\n"))
    log = read_log(path, ROBOT)
    assert "brake" not in log.signals and "brake holds other cells than 0 and 1" in log.note


def test_a_joint_with_limits_that_turns_on_needs_the_limits_of_none(tmp_path):
    path = tmp_path / "log.csv"
    wrapped = (2.5 * T + np.pi) % (2 * np.pi) - np.pi
    rows = (f"{t:.2f},0,0,{angle:.5f},0,0,0\n" for t, angle in zip(T, wrapped, strict=True))
    path.write_text(HEADER + "".join(rows))
    with pytest.raises(InputError, match=r"elbow turns on beyond its limits .* write limits_deg = \[-360, 360\]"):
        read_log(path, ROBOT)


def test_axes_that_the_robot_does_not_have_are_said(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(HEADER.replace("q6", "q6,q7") + ROWS.replace("\n", ",0.6\n"))
    assert "has 7 axes, ur10e has 6" in read_log(path, ROBOT).note


LINK = (
    '<link name="{0}"><inertial><origin xyz="0 0 0.1" rpy="{2}"/><mass value="{1}"/>'
    '<inertia ixx="{3}" iyy="{3}" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/><origin xyz="0 0 0.3"/>'
    '<axis xyz="0 1 0"/><limit lower="-2" upper="{2}" effort="90" velocity="2"/></joint>'
)


def urdf(mass="2", rpy="0 0 0", moment="0.02", upper="2", head="<robot name='two'>"):
    links = "".join(LINK.format(f"l{k}", mass, rpy, moment) for k in (1, 2))
    return f"{head}<link name='l0'/>{links}{JOINT.format(1, 0, upper)}{JOINT.format(2, 1, upper)}</robot>"


@pytest.mark.parametrize(
    "content",
    [
        urdf().encode(),
        b"\n\n<?xml version='1.0'?>" + urdf().encode(),
        f"<?xml version='1.0' encoding='utf-8'?><!-- Gr\u00f6\u00dfe -->{urdf()}".encode("cp1252"),
        urdf(head="<robot name='two' xmlns='http://www.ros.org'>").encode(),
        urdf(upper="1e+16").encode(),
    ],
)
def test_urdfs_of_other_tools_are_read(tmp_path, content):
    path = tmp_path / "two.urdf"
    path.write_bytes(content)
    assert describe_urdf(path).robot.axes == 2


@pytest.mark.parametrize(
    ("content", "remedy"),
    [
        (urdf(mass="${m}"), "xacro FILE > robot.urdf"),
        (urdf(rpy="0 90 0"), "in degrees"),
        ("", "is empty"),
        ("version https://git-lfs.github.com/spec/v1", "git lfs pull"),
        ("<!DOCTYPE html><html></html>", "is a web page"),
        ("<sdf version='1.7'/>", "sdf2urdf"),
        (urdf().replace("<mass", "<mass value='9'/><mass", 1), "more than one <mass>"),
        (urdf().replace("<limit", "<limit lower='0' upper='1'/><limit", 1), "more than one <limit>"),
    ],
)
def test_what_is_no_urdf_is_refused_with_the_remedy(tmp_path, content, remedy):
    path = tmp_path / "two.urdf"
    path.write_text(content)
    with pytest.raises(InputError, match=remedy):
        describe_urdf(path)


def test_tensors_that_are_placeholders_are_doubted(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(urdf(moment="1e-9"))
    robot = RobotDescription.model_validate(describe_urdf(path).table)
    assert any("would be a point" in finding.advice for finding in implausible(robot))
