"""Merging a log with its power."""

from pathlib import Path

import numpy as np

from acqd.dataset.merge import merge
from acqd.dataset.power import PowerStream
from acqd.robot.log import RobotLog


def test_a_gap_in_either_side_is_no_valid_row():
    t = np.arange(0, 20, 0.04)
    time_ns = np.rint((1000 + t) * 1e9).astype(np.int64)
    keep = (t < 5) | (t > 6)
    power = PowerStream(time_ns[keep], (100 + t)[keep], 0 * t[keep] + 230, 40_000_000, 0, False, "x")
    own = np.arange(0.5, 19, 0.04)
    own = own[(own < 10) | (own > 12)]
    log = RobotLog(Path("x.csv"), own + 1003.0, np.column_stack([own, 2 * own]))
    recording = merge("x", log, power, 3.0, 0.0, 0.04)
    at = (recording.time_ns - time_ns[0]) * 1e-9 - 0.02
    inside = recording.valid
    assert not inside[(at > 5.1) & (at < 5.9)].any() and not inside[(at > 10.2) & (at < 11.8)].any()
    assert inside[(at > 1) & (at < 4.8)].all() and inside[(at > 12.3) & (at < 18)].all()
    np.testing.assert_allclose(recording.columns["P"][inside], 100 + at[inside], atol=1e-6)
    np.testing.assert_allclose(recording.columns["q2"][inside], 2 * (at[inside] + 0.02), atol=1e-6)


def test_a_faster_log_is_averaged_before_it_is_thinned():
    t = np.arange(0, 10, 0.04)
    power = PowerStream(np.rint((50 + t) * 1e9).astype(np.int64), 100 + t, 0 * t, 40_000_000, 0, False, "x")
    own = np.arange(0, 9.9, 0.001)
    hum = np.sin(2 * np.pi * 50 * own)  # twice per 40 ms: alias to nothing but noise if only picked
    log = RobotLog(Path("x.csv"), own + 50, (own + hum)[:, None])
    recording = merge("x", log, power, 0.0, 0.0, 0.04)
    at = recording.time_ns * 1e-9 - 50
    inner = slice(2, -2)
    np.testing.assert_allclose(recording.columns["q1"][inner], at[inner], atol=0.01)
