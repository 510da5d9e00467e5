"""First-order filters in C are those of scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from acqd.models import first_order

NUMBERS = st.floats(-1.0, 1.0)


def as_scipy(b, a, values, state):
    out, _ = lfilter(b, [1.0, a], values, axis=0, zi=state)
    return out


@given(
    b=st.tuples(NUMBERS, NUMBERS), a=st.floats(-0.99, 0.99), rows=st.integers(1, 30),
    columns=st.sampled_from([(), (1,), (7,), (2, 3)]), seed=st.integers(0, 99),
)  # fmt: skip
def test_rows_and_their_means_are_those_of_scipy(b, a, rows, columns, seed):
    if first_order.library() is None:
        pytest.skip("no C compiler")
    random = np.random.default_rng(seed)
    values, state = random.normal(size=(4 * rows, *columns)), random.normal(size=(1, *columns))
    expected = as_scipy(b, a, values, state)
    np.testing.assert_array_equal(first_order.filtered(b, a, values, state)[0], expected)
    means = (expected[::4] + expected[1::4] + expected[2::4] + expected[3::4]) / 4
    np.testing.assert_array_equal(first_order.filtered(b, a, values, state, 4)[0], means)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_filter_goes_on_where_the_last_piece_ended(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(first_order, "library", lambda: None)
    values = np.random.default_rng(3).normal(size=(24, 2))
    whole, _ = first_order.filtered((0.3, 0.2), -0.5, values, np.ones((1, 2)), 4)
    first, state = first_order.filtered((0.3, 0.2), -0.5, values[:8], np.ones((1, 2)), 4)
    then, _ = first_order.filtered((0.3, 0.2), -0.5, values[8:], state, 4)
    np.testing.assert_allclose(np.concatenate([first, then]), whole, rtol=1e-14)


def test_columns_that_lie_apart_are_filtered_alike():
    values = np.random.default_rng(4).normal(size=(8, 6))
    some, _ = first_order.filtered((0.3, 0.2), -0.5, values[:, ::2], np.zeros((1, 3)))
    np.testing.assert_array_equal(some, first_order.filtered((0.3, 0.2), -0.5, values, np.zeros((1, 6)))[0][:, ::2])


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(("rows", "state", "together"), [(8, (1,), 1), (8, (1, 3), 1), (8, (2, 2), 1), (7, (1, 2), 4)])
def test_a_state_or_rows_that_do_not_fit_are_refused(compiled, rows, state, together, monkeypatch):
    if not compiled:
        monkeypatch.setattr(first_order, "library", lambda: None)
    with pytest.raises(ValueError, match="do not fit"):
        first_order.filtered((0.3, 0.2), -0.5, np.zeros((rows, 2)), np.zeros(state), together)
    assert len(first_order.filtered((0.3, 0.2), -0.5, np.zeros((0, 2)), np.zeros((1, 2)), 4)[0]) == 0
