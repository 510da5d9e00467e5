"""Long logs in pieces."""

import numpy as np
import pyarrow.parquet
import pytest

from acqd.dataset.cut import CONTEXT_ROWS
from acqd.models.segments import load_dataset
from tests.dataset.logs import build_from, motion, write_log

STEP_S = 0.04


def dataset(folder, seconds, **options):
    write_log(folder / "logs" / "long.csv", *motion(seconds))
    return build_from(folder / "logs", folder / "ds", **options)


@pytest.mark.parametrize("cut_s", [7.0, "auto"])
def test_pieces_have_the_motion_of_the_whole_log_up_to_their_edges(tmp_path, cut_s):
    dataset(tmp_path, 70, cut_s=cut_s)
    time, q, _ = motion(70)
    whole = time[0] + STEP_S * np.arange(70 / STEP_S)
    speed, acceleration = (np.gradient(x, time, axis=0) for x in (q, np.gradient(q, time, axis=0)))
    segments = load_dataset(tmp_path / "ds").segments
    assert len(segments) >= 9 and sum(len(s.P) for s in segments) == pytest.approx(len(whole), abs=2 * len(segments))
    for segment in segments:
        _, qd, qdd = segment.motion(STEP_S)
        at = segment.start_s + STEP_S * np.arange(len(segment.P))
        true = [np.column_stack([np.interp(at, time, x) for x in values.T]) for values in (speed, acceleration)]
        inner = slice(None) if at[0] > 101 and at[-1] < 169 else slice(2, -2)  # where the log itself begins and ends
        assert np.abs(qd - true[0])[inner].max() < 0.05 and np.abs(qdd - true[1])[inner].max() < 1.2
    starts = sorted(segment.start_s for segment in segments)
    assert min(np.diff(starts)) > 4.9


def test_an_even_cut_gives_spikes_without_the_rows_around(tmp_path):
    dataset(tmp_path, 70, cut_s=7.0)
    worst = 0.0
    for segment in load_dataset(tmp_path / "ds").segments:
        spike = abs(segment.around(1)[0] - 2 * segment.q[0] + segment.q[1]).max()
        rested = abs(segment.q[1] - segment.q[0]).max()
        worst = max(worst, rested - spike)
    assert worst / STEP_S**2 > 5  # rad/s^2: the test above would fail


def test_an_automatic_cut_lies_in_rests_and_says_why(tmp_path):
    report = dataset(tmp_path, 150, cut_s="auto")
    note = next(note for note in report.notes if "cut into" in note)
    cuts = report.recordings - 1
    assert f"; {cuts} of {cuts} cuts are where the arm rests" in note and "5 s are the least for the noise m" in note
    for segment in load_dataset(tmp_path / "ds").segments:
        assert 5.0 - 2 * STEP_S <= len(segment.P) * STEP_S <= 60
    assert report.split["train"] > report.split["test"] >= 1 <= report.split["validation"]


def test_context_rows_are_no_rows_of_the_piece(tmp_path):
    dataset(tmp_path, 70, cut_s=7.0)
    for path in (tmp_path / "ds" / "recordings").glob("*.parquet"):
        table = pyarrow.parquet.read_table(path)
        valid, context = table["valid"].to_numpy(), table["context"].to_numpy()
        assert not (valid & context).any() and context.sum() <= 2 * CONTEXT_ROWS + 2


def test_a_single_long_log_is_cut_unless_told_otherwise_and_several_are_not(tmp_path):
    assert dataset(tmp_path / "a", 40).recordings > 3
    assert dataset(tmp_path / "b", 40, cut_s=0).recordings == 1
    assert dataset(tmp_path / "c", 15).recordings == 1
    write_log(tmp_path / "d" / "logs" / "other.csv", *motion(40, 3, 500.0))
    several = dataset(tmp_path / "d", 40)
    assert several.recordings == 2 and any("--cut auto cuts them into pieces" in note for note in several.notes)
    assert not any("--cut auto" in note for note in dataset(tmp_path / "e", 15).notes)
