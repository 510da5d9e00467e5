"""Power that the meter has averaged on one side only."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from acqd.discrepancy.averaging import with_like_means
from acqd.discrepancy.recordings import Subject
from acqd.models.metrics import predictions
from acqd.models.segments import Dataset
from tests.builders import STEP, recording


@pytest.fixture(scope="module")
def sides(model):
    """Recordings in question and of the reference, with a payload's worth of unexplained power in question."""
    asked = [recording(model, k, seed=3) for k in range(4)]
    loaded = [replace(s, P=s.P + 0.2 * (p - p.mean())) for s, p in zip(asked, predictions(model, asked), strict=True)]
    return loaded, [recording(model, k, seed=4) for k in range(4)]


def subject(model, robot, asked, reference):
    data = Dataset(Path("ds"), "", robot.name, robot.name, STEP, "mains", asked)
    return Subject(
        None, model, model, robot, data, "change", asked[:3], asked[3:], reference, frozenset(), frozenset(), []
    )


def averaged(segments, rows, late=0):
    kernel = np.ones(rows) / rows
    return [
        replace(s, P=np.convolve(np.pad(s.P, (rows // 2 + late, rows // 2), mode="edge"), kernel, "valid")[: len(s.P)])
        for s in segments
    ]


def test_like_meters_leave_power_as_it_is(model, robot, sides):
    asked, reference = sides
    for rows in (1, 5):  # the same mean on both sides is no difference
        before = subject(model, robot, averaged(asked, rows), averaged(reference, rows))
        after, lines = with_like_means(before)
        assert after is before and not lines
    alone = subject(model, robot, averaged(asked, 5), [])
    assert with_like_means(alone) == (alone, [])


def test_power_that_is_explained_as_well_as_in_the_reference_is_left_as_it_is(model, robot, sides):
    """A mean that costs less than what the reference leaves unexplained anyway."""
    asked, reference = sides
    random = np.random.default_rng(5)
    noisy = [replace(s, P=s.P + random.normal(0, 30.0, len(s.P))) for s in reference]
    before = subject(model, robot, averaged(asked, 5), noisy)
    assert with_like_means(before) == (before, [])


def moves(axes, seed, rows=70):
    """[700, axes] rad from point to point, with pauses."""
    random, t = np.random.default_rng(seed), np.arange(700)
    q = np.zeros((len(t), axes))
    for begin in range(0, len(t) - rows, rows + 12):
        s = np.clip((t - begin) / rows, 0, 1)
        q += (s**3 * (10 - 15 * s + 6 * s**2))[:, None] * random.uniform(-0.02, 0.02, axes) * rows
    return q


def test_a_meter_that_cuts_off_the_peaks_does_not_smooth(model, robot):
    """A mean makes peaks lower, too, and explains a fifth of what is missing."""
    signals = {"brake": np.ones(700), "tool": np.zeros(700)}
    whole = [replace(recording(model, k), q=moves(model.axes, k % 4), signals=signals) for k in range(8)]
    noise = [np.random.default_rng(k).normal(0, 1, len(s.P)) for k, s in enumerate(whole)]
    pairs = zip(whole, predictions(model, whole), noise, strict=True)
    whole = [replace(s, P=predicted + more) for s, predicted, more in pairs]
    asked = [replace(s, P=np.minimum(s.P, np.percentile(s.P, 80))) for s in whole[:4]]
    before = subject(model, robot, asked, whole[4:])
    assert with_like_means(before) == (before, [])


@pytest.mark.parametrize("late", [0, 2])
def test_a_mean_in_question_alone_is_said_and_fast_power_is_put_back(model, robot, sides, late):
    asked, reference = sides
    given = subject(model, robot, averaged(asked, 5, late), reference)
    after, (line,) = with_like_means(given)
    assert "recordings in question is as if it were a mean over 0.2 s" in line and "same meter" in line
    whole = averaged(asked, 1, late)
    for segments, true, wrong in ((after.fit, whole[:3], given.fit), (after.held_out, whole[3:], given.held_out)):
        for restored, fast, slow in zip(segments, true, wrong, strict=True):
            assert np.std((restored.P - fast.P)[20:-20]) < 0.4 * np.std((slow.P - fast.P)[20:-20])


def test_a_mean_in_the_reference_alone_is_said_and_taken_in_question_too(model, robot, sides):
    asked, reference = sides
    after, (line,) = with_like_means(subject(model, robot, asked, averaged(reference, 7)))
    assert "power of the reference is as if it were a mean over 0.28 s" in line
    for own, expected in zip([*after.fit, *after.held_out], averaged(asked, 7), strict=True):
        assert np.allclose(own.P, expected.P)


def test_a_filter_is_no_mean(model, robot, sides):
    asked, reference = sides
    keep = np.exp(-1 / 8)
    slow = [replace(s, P=lfilter([1 - keep], [1, -keep], s.P, zi=s.P[:1] * keep)[0]) for s in asked]
    after, (line,) = with_like_means(subject(model, robot, slow, reference))
    assert "smoothed with a time constant of 0.32 s" in line
    late = np.std((after.fit[0].P - asked[0].P)[20:-20])
    assert late < 0.5 * np.std((slow[0].P - asked[0].P)[20:-20])
