"""Power and motion of different times, where a lag was given and nothing was aligned."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acqd.dataset.power import PowerStream
from acqd.dataset.rejoined import rejoined
from acqd.dataset.unaligned import clock_doubts, pair_of
from acqd.robot import load_description
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import read_log
from tests.dataset.test_column_check import recordings_of
from tests.places import ROBOT_LOGS, needs_robot_logs

UR10E = load_description("ur10e")
LAG_S = -1.65
"""Controller minus power clock."""
STEP_S = 0.04


@pytest.fixture(scope="module")
def sides():
    """Three logs of random motion, 40 s apart, and the rows of a meter from before the first to after the last."""
    random = np.random.default_rng(7)
    t = np.arange(0.0, 130.0, STEP_S)
    size, rate, phase = (random.uniform(*bounds, (2, 6, 1)) for bounds in ((0.3, 0.6), (0.2, 0.9), (0, 6)))
    angle = 2 * np.pi * rate * t + phase
    q, qd = (size * np.sin(angle)).sum(axis=0).T, (size * 2 * np.pi * rate * np.cos(angle)).sum(axis=0).T
    P = 60 + (8 * np.abs(qd) + 4 * qd**2).sum(axis=1) + random.normal(0, 0.5, len(t))
    time_ns = np.rint(1e9 * (t - STEP_S / 2)).astype(np.int64)
    power = PowerStream(time_ns, P, np.full(len(P), 230.0), round(1e9 * STEP_S), 0, "mains", "power")
    parts = [slice(first, first + 700) for first in (200, 1200, 2200)]
    return [RobotLog(Path(f"log_{k}"), t[part] + LAG_S, q[part]) for k, part in enumerate(parts)], power


def doubts(logs, power, lag_s):
    return clock_doubts([(log, power) for log in logs], UR10E, lambda fits_s: f"give --lag {fits_s:.2f}", lag_s)


@pytest.mark.parametrize("lag_s", [0.0, -3.0])
def test_a_wrong_lag_is_said_with_the_one_that_fits(sides, lag_s):
    (line,) = doubts(*sides, lag_s)
    beyond_s = float(line.split(" +- ")[0].rsplit(" ")[-1])
    assert beyond_s == pytest.approx(abs(LAG_S - lag_s), abs=0.02)
    assert ("before" if lag_s < LAG_S else "after") in line and "in 3 of 3 recordings" in line
    assert float(line.split("--lag ")[1]) == pytest.approx(LAG_S, abs=0.02)


def test_the_right_lag_and_power_that_is_too_slow_raise_no_doubt(sides):
    logs, power = sides
    assert doubts(logs, power, LAG_S) == [] == doubts(logs, power, LAG_S + 0.04)  # a supply's delay
    rows = 25
    slow = replace(
        power,
        time_ns=power.time_ns[::rows],
        P=power.P[::rows],
        Vrms=power.Vrms[::rows],
        window_ns=rows * power.window_ns,
    )
    assert doubts(logs, slow, 0.0) == [] == doubts(logs[:2], power, 0.0)  # two recordings do not prove a clock


@needs_robot_logs
@pytest.mark.parametrize("joined", [True, False])
def test_seconds_of_motion_on_the_clock_of_their_power_raise_no_doubt(joined):
    pieces = []
    for path in sorted((ROBOT_LOGS / "ur10e").glob("ur-20_02*.csv"))[:4]:
        (whole,) = recordings_of(UR10E, [read_log(path, UR10E)])
        for number, rows in enumerate(np.array_split(np.arange(len(whole.valid)), len(whole.valid) // 75)):
            columns = {name: column[rows] for name, column in whole.columns.items()}
            apart_ns = 0 if joined else number * 1000 * 10**9
            piece = replace(whole, name=f"{whole.name}_p{number:03d}", columns=columns, valid=whole.valid[rows])
            pieces.append(replace(piece, time_ns=whole.time_ns[rows] + apart_ns))
    together = rejoined(pieces, UR10E.axes) if joined else pieces
    assert len(together) == (4 if joined else len(pieces))
    assert clock_doubts([pair_of(each, UR10E, STEP_S) for each in together], UR10E, str) == []
