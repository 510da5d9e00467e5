"""Positions of few digits, from speeds of more digits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.robot.integrated import from_speeds
from acqd.robot.resolution import smoothing_of, steps_of

LIMIT = np.array([0.1])


def slide(step_s=0.1, seconds=100.0, seed=0):
    """Times, places and speeds of a slide that moves at some mm/s."""
    t = np.arange(0, seconds, step_s)
    random = np.random.default_rng(seed)
    waves = [(0.03 * random.uniform(0.3, 1) / w, w, random.uniform(0, 6)) for w in random.uniform(0.1, 1.5, 4)]
    x = 0.15 + sum(a * np.sin(w * t + phase) for a, w, phase in waves) / 4
    v = sum(a * w * np.cos(w * t + phase) for a, w, phase in waves) / 4
    return t, x[:, None], v[:, None]


def told(t, q, qd):
    return from_speeds(t, q, qd, smoothing_of(t, q, steps_of(q), LIMIT))


@given(seed=st.integers(0, 999), delay_s=st.floats(-0.05, 0.1), factor=st.floats(0.9, 1.1))
@settings(max_examples=25, deadline=None)
def test_places_are_right_to_a_tenth_of_their_digits_behind_late_speeds(seed, delay_s, factor):
    t, x, v = slide(seed=seed)
    late = np.interp(t - delay_s, t, factor * v[:, 0])[:, None].round(5)
    q, axes = told(t, x.round(3), late)
    inner = slice(30, -30)
    assert axes.all()
    assert np.abs(q - x)[inner].std() < 1e-4
    true, found, written = (np.gradient(np.gradient(each[:, 0], t), t)[inner] for each in (x, q, x.round(3)))
    assert np.std(found - true) < 0.1 * np.std(written - true)


@pytest.mark.parametrize("factor", [1000.0, 57.3, -1.0, 0.0])
def test_speeds_of_another_unit_or_sign_are_not_used(factor):
    t, x, v = slide()
    q, axes = told(t, x.round(3), (factor * v).round(5))
    assert not axes.any() and (q == x.round(3)).all()


def test_speeds_of_as_few_digits_are_not_used():
    t, x, v = slide()
    assert not told(t, x.round(3), v.round(2))[1].any()


def test_a_place_that_is_no_rounded_one_stays_for_other_checks_to_see():
    t, x, v = slide()
    q = x.round(3)
    q[400] = 0.25
    places, axes = told(t, q, v.round(5))
    assert axes.all() and places[400, 0] == 0.25
    others = np.delete(np.arange(30, 970), 370)
    assert np.abs(places - x)[others].max() < 1e-3
