"""Power and logs of different days: the line says of which, and what the distance suggests."""

from pathlib import Path

import numpy as np
import pytest

from acqd.dataset.no_overlap import far_apart, no_overlap
from acqd.dataset.power import PowerStream
from acqd.robot.log import RobotLog

T0 = 1_700_000_000.0


def stream(first_s):
    time_ns = np.rint((first_s + 0.04 * np.arange(1000)) * 1e9).astype(np.int64)
    return PowerStream(time_ns, np.ones(1000), np.ones(1000), 40_000_000, 0, "mains", "power.csv")


def line(power_s, log_s):
    return no_overlap([stream(power_s)], [RobotLog(Path("a.csv"), log_s + np.arange(0, 30, 0.01), np.zeros((3000, 6)))])


@pytest.mark.parametrize(
    ("power_s", "log_s", "remedy"),
    [
        (T0 + 2_082_844_800, T0, "are the power's times counted from 1904-01-01 (LabVIEW)?"),
        (T0, T0 + 2_208_988_800, "are the logs' times counted from 1900-01-01 (NTP)?"),
        (T0 - 315_964_800 + 18, T0, "are the power's times counted from 1980-01-06 (GPS)?"),
        (T0 - 978_307_200, T0, "are the power's times counted from 2001-01-01 (Apple)?"),
        (T0 + 3600, T0, "are they of two time zones? --zone"),
        (T0 - 8 * 3600 - 20, T0, "are they of two time zones? --zone"),
        (T0 + 7 * 86_400, T0, "are they of the same days?"),
        (T0 + 1800, T0, "are they of the same days?"),
    ],
)
def test_the_line_names_both_spans_and_the_likeliest_cause(power_s, log_s, remedy):
    found = line(power_s, log_s)
    assert remedy in found
    assert "2023-11-14T22:13:20Z" in found


def test_logs_of_another_origin_are_shown_in_seconds():
    assert "logs of 5 to 35 s" in line(T0, 5.0)
    assert "logs of -1000000000000 to -999999999970 s" in line(T0, -1e12)


def test_logs_in_a_gap_of_the_power_are_not_called_of_another_zone():
    days = [stream(T0), stream(T0 + 2 * 86_400)]
    log = RobotLog(Path("a.csv"), T0 + 86_400 + np.arange(0, 30, 0.01), np.zeros((3000, 6)))
    assert "has the stream a gap" in no_overlap(days, [log])


@pytest.mark.parametrize(
    ("lag_s", "said"),
    [
        (37.2, ""),
        (-118.0, ""),
        (3637.2, "the logs' clock is 1 h ahead of the meter's"),
        (-5.5 * 3600 + 40, "the meter's clock is 5.5 h ahead of the logs'"),
        (3 * 86_400, "3.0 days before the logs"),
        (-20 * 60 - 130, "22 min after the logs"),
    ],
)
def test_power_that_fits_at_another_time_is_said(lag_s, said):
    logs = [RobotLog(Path("a.csv"), T0 + np.arange(0, 30, 0.01), np.zeros((3000, 6)))]
    lines = far_apart([lag_s, lag_s + 0.1], [stream(T0 - lag_s)], logs)
    assert len(lines) == bool(said) and all(said in line for line in lines), lines


def test_times_that_count_from_the_start_are_far_from_no_clock():
    logs = [RobotLog(Path("a.csv"), np.arange(0, 30, 0.01), np.zeros((3000, 6)))]
    assert far_apart([-T0], [stream(T0)], logs) == []
