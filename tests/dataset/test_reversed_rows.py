"""Rows in reverse order of time."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.dataset.column_check import judge_recordings
from acqd.dataset.rejoined import rejoined
from acqd.dataset.reversed_rows import reversed_rows
from acqd.errors import UserError
from acqd.robot.description import load_description
from acqd.robot.log_reader import read_log
from tests.dataset.test_column_check import recordings_of
from tests.places import ROBOT_LOGS, needs_robot_logs

pytestmark = needs_robot_logs


@pytest.fixture(scope="module")
def ur10e():
    robot = load_description("ur10e")
    return robot, [read_log(path, robot) for path in sorted((ROBOT_LOGS / "ur10e").glob("ur-20_02*.csv"))[:4]]


def turned(recording, *, power):
    columns = {
        name: column if name == "P" and not power else column[::-1] for name, column in recording.columns.items()
    }
    return replace(recording, columns=columns)


def cut(recording):
    """Two pieces, each with some rows of the other that are not used."""
    half, rows = len(recording.valid) // 2, np.arange(len(recording.valid))
    for number, (own, some) in enumerate([(rows < half, rows < half + 12), (rows >= half, rows >= half - 12)], 1):
        columns = {name: column[some] for name, column in recording.columns.items()}
        yield replace(
            recording, name=f"{recording.name}_p{number:03d}", time_ns=recording.time_ns[some], columns=columns,
            valid=own[some],
        )  # fmt: skip


@pytest.mark.parametrize(("power", "what"), [(True, "the rows of each log are"), (False, "the angles of each log are")])
@pytest.mark.parametrize("in_pieces", [False, True])
def test_rows_in_reverse_order_are_refused(ur10e, power, what, in_pieces):
    robot, logs = ur10e
    recordings = [turned(each, power=power) for each in recordings_of(robot, logs)]
    if in_pieces:
        recordings = [piece for each in recordings for piece in cut(each)]
    with pytest.raises(UserError, match=what):
        judge_recordings(recordings, robot, None)


def test_rows_as_they_were_recorded_are_not_called_reversed(ur10e):
    robot, logs = ur10e
    recordings = recordings_of(robot, logs)
    assert reversed_rows(robot, recordings) == ""
    assert reversed_rows(robot, [piece for each in recordings for piece in cut(each)]) == ""
    noise = np.random.default_rng(4)
    for each in recordings:  # power of another robot explains neither
        each.columns["P"] = 100 + noise.normal(size=len(each.valid)).cumsum()
    assert reversed_rows(robot, recordings) == ""


def test_a_motion_that_is_the_same_in_both_directions_of_time_is_not_called_reversed(ur10e):
    robot, logs = ur10e
    there_and_back = []
    for each in recordings_of(robot, logs):
        columns = {name: np.concatenate([column, column[::-1]]) for name, column in each.columns.items()}
        columns["P"] = 40 + 4000 * sum(np.abs(np.gradient(columns[f"q{axis}"])) for axis in range(1, 7))
        step = int(np.median(np.diff(each.time_ns)))
        time_ns = each.time_ns[0] + step * np.arange(len(columns["P"]))
        there_and_back.append(replace(each, time_ns=time_ns, columns=columns, valid=np.ones(len(time_ns), bool)))
    assert reversed_rows(robot, there_and_back) == ""


def test_logs_of_like_names_that_lie_days_apart_are_not_joined(ur10e):
    robot, logs = ur10e
    whole = recordings_of(robot, logs)[0]
    first, second = cut(whole)
    (joined,) = rejoined([second, first], robot.axes)
    assert joined.valid.sum() == whole.valid.sum() and (joined.columns["q1"] == whole.columns["q1"]).all()
    later = replace(second, time_ns=second.time_ns + 86_400 * 10**9)
    assert [len(each.valid) for each in rejoined([later, first], robot.axes)] == [len(first.valid), len(second.valid)]
    again = replace(second, time_ns=first.time_ns[0] + second.time_ns - second.time_ns[0])  # begins at zero, too
    assert len(rejoined([first, again], robot.axes)) == 2
