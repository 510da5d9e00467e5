"""Benjamini-Hochberg and Benjamini-Yekutieli against published and independent values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import false_discovery_control

from acqd.fleet.false_discovery import adjusted, harmonic

PUBLISHED = [
    0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719, 0.6528, 0.7590, 1.0
]  # fmt: skip
"""Benjamini and Hochberg 1995, section 4.1: four hypotheses are rejected at 0.05, three by Bonferroni."""


def test_the_example_of_the_paper():
    assert (adjusted(np.array(PUBLISHED)) <= 0.05).sum() == 4
    assert (len(PUBLISHED) * np.array(PUBLISHED) <= 0.05).sum() == 3


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60))
def test_the_values_are_those_of_scipy(values):
    p = np.array(values)
    assert adjusted(p) == pytest.approx(false_discovery_control(p, method="bh"))
    assert adjusted(p, "benjamini-yekutieli") == pytest.approx(false_discovery_control(p, method="by"))


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60), st.randoms())
def test_order_does_not_matter_and_a_smaller_p_is_never_less_sure(values, random):
    p = np.array(values)
    order = np.array(random.sample(range(len(p)), len(p)))
    assert adjusted(p)[order] == pytest.approx(adjusted(p[order]))
    q = adjusted(p)
    assert (q >= p - 1e-12).all() and (q <= 1).all()
    assert (np.diff(q[np.argsort(p, kind="stable")]) >= -1e-12).all()


def test_no_robots_no_values():
    assert len(adjusted(np.zeros(0))) == 0 and harmonic(3) == pytest.approx(11 / 6)


def test_the_rate_is_held_on_simulated_fleets():
    random = np.random.default_rng(1)
    shares = []
    for _ in range(400):
        p = random.uniform(size=200)
        p[:20] = random.uniform(size=20) * 1e-4
        found = adjusted(p) <= 0.05
        shares.append(found[20:].sum() / max(found.sum(), 1))
    assert np.mean(shares) < 0.05  # 0.045 is expected: 180 of 200 are unchanged
