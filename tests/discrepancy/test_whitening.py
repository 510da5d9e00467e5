"""The noise model."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from acqd.discrepancy.residual.whitening import Whitener, autocorrelation


@settings(max_examples=15)
@given(st.floats(0.0, 0.95), st.integers(0, 1000))
def test_whitened_noise_is_white(memory, seed):
    random = np.random.default_rng(seed)
    noise = [lfilter([1], [1, -memory], random.normal(0, 2, 3000)) for _ in range(4)]
    white = [Whitener.of(noise).apply(each).astype(float) for each in noise]
    assert np.abs(autocorrelation(white, 10)).max() < 0.06
    assert np.concatenate(white).std() == pytest.approx(1.0, abs=0.06)
