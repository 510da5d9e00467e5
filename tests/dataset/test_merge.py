"""Merging a log with its power."""

from pathlib import Path

import numpy as np

from acqd.dataset.merge import merge
from acqd.dataset.power import PowerStream
from acqd.models.segments import segments_of
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


def merged(own, power):
    """A log of 500 Hz of two joints that swing, merged with 40 ms rows."""
    q = np.column_stack([np.sin(3 * own), np.cos(2 * own)])
    recording = merge("x", RobotLog(Path("x.csv"), own + 50, q), power, 0.0, 0.0, 0.04)
    columns = recording.columns | {"time_ns": recording.time_ns, "valid": recording.valid}
    columns |= {} if recording.context is None else {"context": recording.context}
    return recording, segments_of(columns, {"name": "x", "source": "x", "kind": "other", "split": "train"}, 0.04)


def stream(keep=slice(None)):
    t = np.arange(0, 10, 0.04)[keep]
    return PowerStream(np.rint((50 + t) * 1e9).astype(np.int64), 100 + t, 0 * t, 40_000_000, 0, False, "x")


def test_a_log_cut_in_motion_has_the_motion_of_the_whole():
    own = np.arange(0, 9.9, 0.002)
    for first_s in (3.0, 3.007, 3.021, 3.039):
        recording, (segment,) = merged(own[(own >= first_s) & (own < first_s + 4)], stream())
        at = recording.time_ns * 1e-9 - 50
        np.testing.assert_allclose(recording.columns["q1"], np.sin(3 * at), atol=1e-3)  # 30 mrad by half a window
        assert recording.unknown_ends == 2 == recording.context.sum() and not recording.valid[[0, -1]].any()
        used = np.rint((segment.start_s - 50) / 0.04 - 0.5) * 0.04 + 0.02 + 0.04 * np.arange(len(segment.P))
        np.testing.assert_allclose(segment.motion(0.04)[2][:, 0], -9 * np.sin(3 * used), atol=0.3)


def test_a_log_that_begins_and_ends_at_rest_is_used_whole():
    own = np.arange(0, 9.9, 0.002)
    angle = np.cos(np.clip(own - 3, 0, np.pi))
    recording = merge("x", RobotLog(Path("x.csv"), own + 50, angle[:, None]), stream(), 0.0, 0.0, 0.04)
    assert recording.unknown_ends == 0 and recording.context is None and recording.valid.all()


def test_the_motion_goes_on_where_the_power_is_missing():
    t = np.arange(0, 10, 0.04)
    recording, (before, after) = merged(np.arange(0, 9.9, 0.002), stream((t < 4) | (t > 5)))
    assert len(before.after) == len(after.before) == recording.context.sum() - 2 and len(after.before) > 0
    assert recording.unknown_ends == 2
