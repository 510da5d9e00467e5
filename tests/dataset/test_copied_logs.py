"""A log with the motion of another one is a copy, however it was written, and a repeated program is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acqd.dataset.copied_logs import DistinctLogs
from acqd.errors import InputError
from acqd.robot.log import RobotLog

T0 = 1_700_000_000.0


def require_new(log, others):
    logs = DistinctLogs()
    for each in [*others, log]:
        logs.add(each)


def log(name, first_s=T0, seconds=20.0, rate=100.0, digits=9, late_s=0.0):
    """A motion of six joints that is a function of the time on the wall, as logged from `first_s` on."""
    time = first_s + np.arange(0, seconds, 1 / rate)
    since = (time - T0 - late_s)[:, None] if first_s >= T0 else (time - first_s - late_s)[:, None]
    q = 0.5 * np.sin(since * (0.5 + 0.2 * np.arange(6)) + np.arange(6))
    return RobotLog(Path(name), time, np.round(q, digits))


def resting(name, leaves_s):
    """An arm that leaves its home once, by a clock that a restart of the controller sets back."""
    time = np.arange(0, 20, 0.01)
    move = np.sin(np.clip((time - leaves_s) / 2.0, 0.0, 1.0) * np.pi)
    return RobotLog(Path(name), T0 + time, np.outer(move, np.ones(6)))


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
        resting("b.csv", leaves_s=15.0),
        RobotLog(Path("b.csv"), T0 + np.arange(0, 20, 0.01), np.zeros((2000, 7))),
    ],
    ids=[
        "recorders that overlap",
        "another run",
        "the next log",
        "an arm at rest",
        "at home most of the time",
        "more axes",
    ],
)
def test_other_motion_is_no_copy(another):
    require_new(another, [log("a.csv"), resting("home.csv", leaves_s=4.0)])


def test_two_arms_at_rest_in_one_pose_are_no_copies():
    still = [RobotLog(Path(name), T0 + np.arange(0, 20, 0.01), np.zeros((2000, 6))) for name in "ab"]
    require_new(still[0], still[1:])


COMMANDED = log("a.csv", first_s=0.0)
NOISE = np.random.default_rng(3).normal(0.0, 2.0, (2, 2000))


@pytest.mark.parametrize("column", ["power", "current"])
def test_a_program_that_runs_again_is_no_copy_where_what_was_measured_differs(column):
    """A controller that logs commanded angles over the time since the start repeats them digit by digit."""
    shape = (lambda row: row) if column == "power" else (lambda row: np.outer(row, np.ones(6)))
    runs = [replace(COMMANDED, path=Path(f"{k}.csv"), **{column: shape(200.0 + NOISE[k])}) for k in (0, 1)]
    require_new(*runs[:1], runs[1:])
    with pytest.raises(InputError, match=r"the same motion at the same times as 0\.csv"):
        require_new(replace(runs[0], path=Path("copy.csv")), runs[:1])


def test_an_arm_that_stands_is_logged_as_often_as_one_likes():
    still = [RobotLog(Path(name), np.arange(0, 20, 0.01), np.zeros((2000, 6))) for name in "ab"]
    require_new(still[0], still[1:])


def test_of_times_that_count_from_the_start_only_all_angles_tell():
    with pytest.raises(InputError, match="holds the same motion"):
        require_new(log("b.csv", first_s=0.0), [log("a.csv", first_s=0.0)])
    require_new(log("b.csv", first_s=0.0, digits=4), [log("a.csv", first_s=0.0)])
