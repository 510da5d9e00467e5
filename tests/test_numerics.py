"""The ground floor's methods against their definitions."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import median_abs_deviation, theilslopes

from acqd.numerics import (
    mad_sigma,
    quadratic_form,
    ridge_regression,
    runs_of_true,
    solve_scaled_ridge,
    theil_sen_slope,
)

FLOATS = st.floats(-1e6, 1e6, allow_subnormal=False)


@given(values=arrays(float, st.integers(1, 50), elements=FLOATS))
def test_mad_sigma_is_scipys_for_normal_values(values):
    assert mad_sigma(values) == pytest.approx(median_abs_deviation(values, scale="normal"), rel=1e-4, abs=1e-9)
    assert mad_sigma(values, 0.0) == pytest.approx(1.4826 * np.median(np.abs(values)))


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 40))
@settings(deadline=None)
def test_the_slope_is_scipys_theil_sen(seed, count):
    random = np.random.default_rng(seed)
    t, y = np.sort(random.uniform(0, 100, count)), random.normal(size=count)
    assert theil_sen_slope(t, y, 0.0) == pytest.approx(theilslopes(y, t).slope, rel=1e-9, abs=1e-12)
    assert theil_sen_slope(t, y, 1000.0) == 0.0


@given(flags=arrays(bool, st.integers(0, 60)))
def test_runs_cover_exactly_the_rows_that_are_true(flags):
    again = np.zeros(len(flags), dtype=bool)
    runs = runs_of_true(flags)
    for first, last in runs:
        assert first < last
        again[first:last] = True
    assert (again == flags).all()
    assert all(one[1] < other[0] for one, other in itertools.pairwise(runs))


@given(seed=st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_solutions_do_not_depend_on_the_scale_of_columns(seed):
    random = np.random.default_rng(seed)
    X, y = random.normal(size=(50, 3)), random.normal(size=50)
    scale = 10.0 ** random.uniform(-4, 4, 3)
    expected = np.linalg.lstsq(X, y, rcond=None)[0]
    np.testing.assert_allclose(ridge_regression(X * scale, y, 1e-12) * scale, expected, rtol=1e-6, atol=1e-9)
    scaled = X * scale
    np.testing.assert_allclose(
        solve_scaled_ridge(scaled.T @ scaled, scaled.T @ y, 1e-12) * scale, expected, rtol=1e-5, atol=1e-8
    )


def test_collinear_columns_have_a_solution():
    X = np.ones((20, 2))
    np.testing.assert_allclose(X @ ridge_regression(X, np.full(20, 3.0), 1e-7), 3.0, rtol=1e-5)


@given(st.integers(1, 6), st.integers(0, 10_000))
def test_the_quadratic_form_agrees_with_the_inverse(size, seed):
    random = np.random.default_rng(seed)
    root = random.normal(size=(size + 5, size)) * 10.0 ** random.uniform(-3, 3, size)
    V, u = root.T @ root, root.T @ random.normal(size=size + 5)
    value, rank = quadratic_form(V, u)
    assert rank == size
    np.testing.assert_allclose(value, u @ np.linalg.solve(V, u), rtol=1e-5)


def test_directions_in_which_nothing_varies_do_not_count():
    V = np.array([[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 1.0]])
    value, rank = quadratic_form(V, np.array([[2.0, 2.0, 3.0], [0.0, 0.0, 1.0]]))
    assert rank == 2
    np.testing.assert_allclose(value, [1.0 + 9.0, 1.0])
