"""Moments of switching within rows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from acqd.discrepancy.loads.edges import shares_of_rows
from acqd.residual.whitening import Whitener

ROWS = 1500


def _load(first, period, share):
    """[T] mean of a load that is on for 60 rows of every `period`, from a moment within a row on."""
    fine = (np.arange(ROWS * 20) / 20 - first - share) % period < 60
    return fine.reshape(ROWS, 20).mean(axis=1)


@settings(max_examples=15, deadline=None)
@given(st.integers(30, 90), st.integers(150, 400), st.floats(0.05, 0.95), st.floats(3.0, 20.0))
def test_shares_of_rows_and_the_size_are_those_of_the_load(first, period, share, size):
    random = np.random.default_rng(4)
    noise = [lfilter([0.3], [1, -0.8], random.normal(0, 1, ROWS)) for _ in range(4)]
    true = [_load(first + 17 * k, period, share) for k in range(4)]
    residuals = [n + size * on for n, on in zip(noise, true, strict=True)]
    whitener = Whitener.of(noise)
    ones = [np.ones(ROWS)] * 4
    rounded = [on >= 0.5 for on in true]
    shares, fitted = shares_of_rows(residuals, whitener, ones, rounded, 0.8 * size)
    error = np.mean([np.abs(a - b).sum() for a, b in zip(shares, true, strict=True)])
    switchings = 2 * ROWS / period + 1
    assert error < switchings * (1.2 * 0.3 / size + 0.02)  # 0.3 W is the noise of a row given the rows before
    assert fitted == pytest.approx(size, abs=0.35)
    assert all(each.min() >= 0 and each.max() <= 1 for each in shares)
