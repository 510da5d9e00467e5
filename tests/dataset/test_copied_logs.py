"""A log with the motion of another one is a copy, however it was written; a repeated program is none."""

from pathlib import Path

import numpy as np
import pytest

from acqd.dataset.copied_logs import require_new
from acqd.errors import InputError
from acqd.robot.log import RobotLog

T0 = 1_700_000_000.0


def log(name, first_s=T0, seconds=20.0, rate=100.0, digits=9, late_s=0.0):
    """A motion of six joints that is a function of the time on the wall, as logged from `first_s` on."""
    time = first_s + np.arange(0, seconds, 1 / rate)
    since = (time - T0 - late_s)[:, None] if first_s >= T0 else (time - first_s - late_s)[:, None]
    q = 0.5 * np.sin(since * (0.5 + 0.2 * np.arange(6)) + np.arange(6))
    return RobotLog(Path(name), time, np.round(q, digits))


@pytest.mark.parametrize(
    "copy",
    [
        log("b.csv"),
        log("b.csv", digits=4),
        log("b.csv", rate=50.0),
        log("b.csv", first_s=T0 + 4.0, seconds=12.0),
        log("b.csv", first_s=T0 + 4.0),
    ],
    ids=["the same", "fewer digits", "every other row", "a part", "most of it"],
)
def test_the_same_poses_at_the_same_times_are_a_copy(copy):
    with pytest.raises(InputError, match=r"holds the same motion at the same times as a\.csv"):
        require_new(copy, [log("other.csv", first_s=T0 + 100), log("a.csv")])


@pytest.mark.parametrize(
    "another",
    [
        log("b.csv", first_s=T0 + 18.0),
        log("b.csv", late_s=0.05),
        log("b.csv", first_s=T0 + 20.0),
        RobotLog(Path("b.csv"), T0 + np.arange(0, 20, 0.01), np.zeros((2000, 6))),
        RobotLog(Path("b.csv"), T0 + np.arange(0, 20, 0.01), np.zeros((2000, 7))),
    ],
    ids=["recorders that overlap", "another run", "the next log", "an arm at rest", "more axes"],
)
def test_other_motion_is_no_copy(another):
    require_new(another, [log("a.csv")])


def test_two_arms_at_rest_in_one_pose_are_no_copies():
    still = [RobotLog(Path(name), T0 + np.arange(0, 20, 0.01), np.zeros((2000, 6))) for name in "ab"]
    require_new(still[0], still[1:])


def test_of_times_that_count_from_the_start_only_all_angles_tell():
    with pytest.raises(InputError, match="holds the same motion"):
        require_new(log("b.csv", first_s=0.0), [log("a.csv", first_s=0.0)])
    require_new(log("b.csv", first_s=0.0, digits=4), [log("a.csv", first_s=0.0)])
