"""Evidence: a marginal likelihood within physical bounds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import norm

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.selection.ranking import Finding, beyond_bounds, posterior, within

FREE = np.array([-np.inf]), np.array([np.inf])


def test_two_shapes_of_one_effect_have_their_own_places_in_a_list():
    cold = Candidate("thermal_friction", "joint 2", np.array([3, 4]))
    warm = replace(cold, indices=np.array([5, 6]))
    findings = [Finding(candidate, np.array([1.0, 2.0]), np.ones(2), 2.0) for candidate in (cold, warm)]
    assert findings.index(findings[1]) == 1
    assert findings[0] != replace(findings[0])


@given(st.floats(0.1, 50), st.floats(-30, 30), st.floats(0.1, 3), st.floats(-2, 0), st.floats(0.1, 2))
def test_the_evidence_is_that_of_an_integral_over_the_truncated_prior(S, h, D, low, high):
    theta, _, evidence = posterior(np.array([[S]]), np.array([h]), np.array([D]), np.array([low]), np.array([high]))
    inside = norm.cdf(high / D) - norm.cdf(low / D)

    def integrand(value):
        return np.exp(h * value - S * value**2 / 2) * norm.pdf(value, scale=D) / inside

    best = float(np.clip(h / (S + D**-2), low, high))
    whole = quad(integrand, low, high, points=[best], epsabs=0, limit=200)[0]
    assert evidence == pytest.approx(2 * np.log(whole), abs=1e-3, rel=1e-3)
    assert low <= theta[0] <= high


@given(st.integers(1, 4), st.integers(0, 999))
def test_without_bounds_the_evidence_is_a_ratio_of_gaussians(size, seed):
    random = np.random.default_rng(seed)
    X, y, D = random.normal(size=(20, size)), random.normal(size=20), random.uniform(0.1, 3, size)
    theta, deviation, evidence = posterior(X.T @ X, X.T @ y, D, np.full(size, -np.inf), np.full(size, np.inf))
    covariance = np.eye(20) + (X * D**2) @ X.T
    marginal = -np.linalg.slogdet(covariance)[1] - y @ np.linalg.solve(covariance, y)
    assert evidence == pytest.approx(marginal + y @ y)
    precision = X.T @ X + np.diag(D**-2.0)
    assert theta == pytest.approx(np.linalg.solve(precision, X.T @ y))
    assert deviation == pytest.approx(np.sqrt(np.diag(np.linalg.inv(precision))))


def test_what_physics_forbids_counts_as_much_as_the_nearest_possible_size():
    """A share of 3.44 of the mechanical power, where at most 1 can be lost; a negative one has no evidence at all."""
    S, h, D = np.array([[400.0]]), np.array([400.0 * 3.44]), np.array([0.2])
    free, bounded = posterior(S, h, D, *FREE), posterior(S, h, D, np.array([-0.05]), np.array([1.0]))
    assert bounded[0][0] == 1.0 and bounded[2] == pytest.approx(2 * h[0] - S[0, 0], rel=0.05) and bounded[2] < free[2]
    negative = posterior(S, -h, D, np.array([0.0]), np.array([1.0]))
    assert negative[2] < 0 and negative[0][0] == 0.0


@given(st.integers(0, 99))
def test_sizes_that_lie_within_their_bounds_keep_their_evidence(seed):
    """An idle joint whose loss would fall below zero takes nothing from the joint whose loss has changed."""
    random = np.random.default_rng(seed)
    precision, theta = np.diag([400.0, 4.0]), np.array([2.0, -random.uniform(0, 0.3)])
    low, high = np.array([-1.0, 0.0]), np.array([5.0, 5.0])
    h = precision @ theta
    clipped = within(precision, h, theta.copy(), low, high)
    assert clipped == pytest.approx([2.0, 0.0], abs=1e-6)
    assert beyond_bounds(precision, h, clipped) == pytest.approx(4.0 * theta[1] ** 2)
    assert beyond_bounds(precision, h, within(precision, h, theta.copy(), low, np.array([1.0, 5.0]))) > 100.0
    assert beyond_bounds(precision, h, theta) == pytest.approx(0.0)
