"""Segments with and without the rows around them."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.models.bundle.reference import _segments, reference_arrays
from acqd.models.features import continued, motion
from acqd.models.metrics import predictions
from acqd.models.segments import segments_of

STEP_S = 0.04


def columns(rows=200, **more):
    t = STEP_S * np.arange(rows)
    q = {f"q{k + 1}": np.sin(t + k) for k in range(7)}
    return {"time_ns": (1e9 * t).astype(np.int64), "P": 100 + t, **q, "valid": np.ones(rows, bool), **more}


ENTRY = {"name": "a", "source": "a", "kind": "a", "split": "train"}


def piece(first, last):
    """Rows of the whole as a piece that knows its neighbours."""
    inside = np.zeros(200, bool)
    inside[first:last] = True
    return segments_of(columns(valid=inside, context=~inside), ENTRY, STEP_S)[0]


def test_a_piece_has_the_derivatives_of_the_whole():
    whole = segments_of(columns(), ENTRY, STEP_S)[0]
    for values, parts in zip(whole.motion(STEP_S), piece(60, 130).motion(STEP_S), strict=True):
        np.testing.assert_array_equal(parts, values[60:130])
    np.testing.assert_array_equal(piece(60, 130).around(5), whole.q[55:135])


def test_beyond_the_known_rows_the_motion_fades():
    whole = segments_of(columns(), ENTRY, STEP_S)[0]
    np.testing.assert_array_equal(whole.around(4), continued(whole.q, 4))
    for values, same in zip(whole.motion(STEP_S), motion(whole.q, STEP_S), strict=True):
        np.testing.assert_array_equal(values, same)
    np.testing.assert_array_equal(piece(2, 80).around(6), continued(whole.q, 4)[: 80 + 4 + 6])
    np.testing.assert_array_equal(piece(60, 130).around(0), whole.q[60:130])


def test_rows_behind_a_gap_are_no_neighbours():
    data = columns()
    data["valid"][:60] = data["valid"][130:] = False
    data["context"] = np.zeros(200, bool)
    data["context"][50:58] = data["context"][130:140] = True  # two rows are missing before the piece
    found = segments_of(data, ENTRY, STEP_S)[0]
    assert len(found.before) == 0 and len(found.after) == 10


def test_content_is_that_of_power_and_angles():
    one = segments_of(columns(), ENTRY, STEP_S)[0]
    dated = columns()
    dated["time_ns"] = dated["time_ns"] + 86_400_000_000_000
    assert segments_of(dated, ENTRY | {"name": "b"}, STEP_S)[0].content == one.content
    other = columns()
    other["P"][17] += 1e-9
    assert segments_of(other, ENTRY, STEP_S)[0].content != one.content


@pytest.mark.parametrize(("before", "after"), [(0, 12), (5, 0), (12, 12), (20, 3)])
def test_bundles_remember_the_rows_around(before, after):
    made = piece(60, 130)
    made = replace(made, before=made.before[len(made.before) - before :], after=made.after[:after])
    known = _segments(reference_arrays([made, segments_of(columns(), ENTRY, STEP_S)[0]]))
    np.testing.assert_allclose(known[0].before, made.before[-12:] if before else made.before, atol=1e-6)
    np.testing.assert_allclose(known[0].after, made.after[:12], atol=1e-6)
    assert len(known[1].before) == len(known[1].after) == 0


def test_a_piece_is_predicted_as_a_part_of_the_whole(grey):
    data, fit = grey
    whole = data.segments[0]
    inner = slice(40, 140)
    part = replace(
        whole, q=whole.q[inner], P=whole.P[inner], signals={name: s[inner] for name, s in whole.signals.items()},
        before=whole.q[28:40], after=whole.q[140:152],
    )  # fmt: skip
    all_rows, rows = predictions(fit.model, [whole])[0][inner], predictions(fit.model, [part])[0]
    assert np.abs(rows - all_rows)[1:].max() < 1e-3 and rows.shape == (100,)  # the supply's lag has 12 rows to settle
    rested = predictions(fit.model, [replace(part, before=None, after=None)])[0]
    assert np.abs(rested - all_rows).max() > 10 * np.abs(rows - all_rows).max()
