"""Rows that two recordings share."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.overlaps import without_shared_rows
from acqd.models.segments import Segment

STEP, LEAST = 0.04, 60
METER_W = 200 + 20 * np.sin(np.arange(4000) / 40) + np.random.default_rng(1).normal(0, 0.4, 4000)


def cut(name, start, rows, noise=()):
    """Rows of the meter from `start` (in rows, also between two of them) on."""
    at = start + np.arange(rows)
    P = np.interp(at, np.arange(4000), METER_W) + (noise if len(noise) else 0.0)
    q = np.column_stack([np.sin(at / 40), np.cos(at / 40)])
    return Segment(name, name, "r", "train", q, P, None, {"brake": at * 1.0}, 1e9 + STEP * start)


def test_a_second_export_and_overlapping_logs_count_once():
    whole, export, late = cut("a", 0, 700), cut("b", 0.37, 698), cut("c", 500.5, 900)
    kept, (line,) = without_shared_rows([late, export, whole], [], STEP, LEAST)
    assert [(each.recording, len(each.P)) for each in kept] == [("a", 700), ("c", 701)]
    assert kept[1].start_s == pytest.approx(late.start_s + 199 * STEP) and len(kept[1].before) == 199
    assert np.array_equal(kept[1].q, late.q[199:])
    assert np.array_equal(kept[1].signals["brake"], late.signals["brake"][199:])
    assert line.startswith("2 recordings hold power rows of others, the first: b those of a;")


def test_rows_of_the_reference_are_not_in_question():
    known = replace(cut("a", 100.2, 500), P=cut("a", 100.2, 500).P.astype(np.float32).astype(float))
    kept, lines = without_shared_rows([cut("a", 100.2, 500), cut("d", 800, 500)], [known], STEP, LEAST)
    assert [each.recording for each in kept] == ["d"] and "a holds power rows of a in the reference" in lines[0]
    kept, lines = without_shared_rows([cut("a", 100.7, 500)], [known], STEP, LEAST)
    assert not kept and lines


def test_like_times_of_other_measurements_are_no_copies():
    """Clocks that start at zero in every run of a program: the motion is the same, the noise is not."""
    random = np.random.default_rng(2)
    runs = [cut(f"run {k}", 0, 700, random.normal(0, 0.4, 700)) for k in range(6)]
    assert without_shared_rows(runs, [], STEP, LEAST) == (runs, [])
    pieces = [cut("a", 0, 700), cut("b", 700, 700), cut("c", 1399, 700)]
    assert without_shared_rows(pieces, [], STEP, LEAST) == (pieces, [])


def test_a_few_seconds_of_other_measurements_are_no_copies():
    """Pieces of logs whose times begin at zero: three means of a second vanish by chance."""
    random = np.random.default_rng(3)
    runs = [cut(f"run {k}", 0, 80, random.normal(0, 0.4, 80)) for k in range(40)]
    assert without_shared_rows(runs, [], STEP, LEAST) == (runs, [])
