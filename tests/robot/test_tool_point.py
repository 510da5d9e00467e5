"""A logged tool point shows whose log it is."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from acqd.errors import InputError
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.log_reader import read_log
from acqd.robot.tool_point import tool_point_error

RTDE = Path(__file__).parents[3] / "shared/data/robots/ur3e_rtde/ur3e_rtde_25s.csv"


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), tool=st.tuples(*3 * [st.floats(-0.3, 0.3)]), turn_deg=st.floats(-180, 180))
def test_any_tool_in_any_frame_of_the_base_fits_its_own_robot_only(seed, tool, turn_deg):
    robot, larger = load_description("ur3e"), load_description("ur10e")
    q = np.random.default_rng(seed).uniform(-1.5, 1.5, (100, 6))
    position, rotation = forward_kinematics(Arm(robot), q)  # Pinocchio, where the check has its own kinematics
    base = Rotation.from_euler("z", turn_deg, degrees=True)
    point = base.apply(position + rotation @ np.array(tool)) + np.array([0.3, -2.0, 0.8])
    assert tool_point_error(robot, q, point) < 1e-6
    assert tool_point_error(larger, q, point) > 0.05


def test_points_that_nobody_knows_say_nothing():
    robot = load_description("ur3e")
    q = np.zeros((5, 6))
    assert tool_point_error(robot, q, np.full((5, 3), np.nan)) == 0.0
    assert tool_point_error(robot, q[:1], np.zeros((1, 3))) == 0.0
    assert tool_point_error(robot, q, np.ones((5, 3))) < 1e-9  # an arm at rest


@pytest.mark.filterwarnings("error")
def test_motion_of_one_wrist_joint_neither_warns_nor_refuses():
    robot = load_description("ur3e")
    q = np.zeros((50, 6))
    q[:, 5] = np.linspace(0, 1, 50)
    position, _ = forward_kinematics(Arm(robot), q)
    assert tool_point_error(robot, q, position) < 1e-6


@pytest.mark.skipif(not RTDE.exists(), reason="recordings are not part of the repository")
def test_a_log_of_a_smaller_arm_is_refused():
    read_log(RTDE, load_description("ur3e"))
    for larger in ("ur10e", "ur5e"):
        with pytest.raises(InputError, match=r"mm \(RMS\) from where the angles put it on .*another robot's log"):
            read_log(RTDE, load_description(larger))
