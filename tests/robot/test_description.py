"""Descriptions of robots, shipped and wrong ones."""

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.robot import load_description
from acqd.robot.newton_euler import Chain, frames
from tests.robot.states import ROBOTS

SHIPPED = [
    "abb_gofa5", "abb_irb120", "crx10ia", "doosan_m1013", "fr3", "franka_panda", "iiwa7_r800", "kinova_gen3",
    "kuka_iiwa14", "ur10e", "ur3e", "ur5e", "xarm6", "xarm7",
]  # fmt: skip


def test_these_robots_are_shipped():
    assert ROBOTS == SHIPPED


def test_an_unknown_robot_is_named_with_those_there_are():
    with pytest.raises(UserError, match="robot 'r2d2' is unknown; known: abb_gofa5, abb_irb120, crx10ia"):
        load_description("r2d2")


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("mass = 3.394011", "mass = -3.4", r"joint 1\.link\.mass: .*greater than 0"),
        ("limits_deg = [-170, 170]", "limits_deg = [170, -170]", r"joint 1\.limits_deg: expected \[lower, upper\]"),
        ('name = "A2"', 'name = "A1"', "joint names .* are not all different"),
        ("axis = [0, 0, 1]", "axes = [0, 0, 1]", r"joint 1\.axes: there is no such key"),
        ("[base]", "[base", "is not valid TOML"),
    ],
)
def test_a_wrong_description_is_named_by_key(tmp_path, old, new, complaint):
    from acqd.robot import description

    text = (description._FOLDER / "iiwa7_r800.toml").read_text()
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=complaint):
        load_description(str(path))


@pytest.mark.parametrize("name", ROBOTS)
def test_what_the_sources_call_assumed_is_marked_as_guessed(name):
    robot = load_description(name)
    text = " ".join(robot.sources)
    assert all(joint.guessed for joint in robot.joint) == ("assumed" in text or "not public" in text)


def test_drive_gains_of_the_ur10e_are_the_published_ones():
    gains = [joint.drive.effort_per_ampere for joint in load_description("ur10e").joint]
    assert gains == pytest.approx([10.0, 10.6956, 8.4566, 9.0029, 9.48, 10.1232], rel=1e-3)


def test_bodies_of_the_m1013_are_where_its_maker_says():
    """The maker's file gives centres of mass [m] in the base frame at zero angles."""
    robot = load_description("doosan_m1013")
    published = [
        [7e-05, 0.044281, 0.143327], [-1.6e-05, 0.189372, 0.418558], [6e-06, 0.07917, 0.781807],
        [-2.1e-05, 0.12337, 1.148], [-1.7e-05, 0.06662, 1.33103], [-0.000174, 0.034708, 1.40022],
    ]  # fmt: skip
    at = frames(Chain.of(robot), np.zeros((1, 6)))
    for joint, rotation, origin, expected in zip(robot.joint, at.rotation[0], at.origin[0], published, strict=True):
        np.testing.assert_allclose(origin + rotation @ joint.link.com, expected, atol=2e-6)
