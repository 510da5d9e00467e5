"""The noise model."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener, autocorrelation


@settings(max_examples=15)
@given(st.floats(0.0, 0.95), st.integers(0, 1000))
def test_whitened_noise_is_white(memory, seed):
    random = np.random.default_rng(seed)
    noise = [lfilter([1], [1, -memory], random.normal(0, 2, 3000)) for _ in range(4)]
    white = [Whitener.of(noise).apply(each).astype(float) for each in noise]
    assert np.abs(autocorrelation(white, 10)).max() < 0.06
    assert np.concatenate(white).std() == pytest.approx(1.0, abs=0.06)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 0.95), st.integers(0, 1000), st.integers(2, 60))
def test_short_pieces_lose_no_rows_and_become_white(memory, seed, rows):
    random = np.random.default_rng(seed)
    noise = [lfilter([1], [1, -memory], random.normal(0, 2, 3000))[500:] for _ in range(4)]
    whitener = Whitener.of(noise, 10, known_level=True)
    pieces = [whitener.from_start(each[first : first + rows]) for each in noise for first in range(0, 2400, rows)]
    assert all(len(piece) == rows for piece in pieces[:-4])
    firsts = np.array([piece[0] for piece in pieces])
    assert firsts.std() == pytest.approx(1.0, abs=5 / np.sqrt(len(firsts)))
    table = np.column_stack([noise[0][:rows], noise[1][:rows]])
    np.testing.assert_allclose(whitener.from_start(table)[:, 1], whitener.from_start(noise[1][:rows]), atol=1e-5)


def test_the_first_rows_know_no_level_unless_it_is_known():
    random = np.random.default_rng(3)
    noise = [lfilter([1], [1, -0.5], random.normal(0, 1, 3000)) for _ in range(3)]
    constant = np.ones(200)
    unknown = Whitener.of(noise, 10).from_start(constant)
    known = Whitener.of(noise, 10, known_level=True).from_start(constant)
    assert (unknown[:10] ** 2).sum() < 0.05 * (known[:10] ** 2).sum()


@given(seed=st.integers(0, 2**32 - 1), rows=st.integers(1, 120), past=st.booleans())
@settings(deadline=None, max_examples=40)
def test_products_of_white_rows_are_products_of_rows_with_the_transposed_filter(seed, rows, past):
    random = np.random.default_rng(seed)
    whitener = Whitener.of([lfilter([1], [1, -0.7], random.normal(size=900))])
    rows += NOISE.noise_order if past else 0
    table, column = random.normal(size=(rows, 3)), random.normal(size=(rows, 2))
    whiten = whitener.apply if past else whitener.from_start
    white = whiten(column)
    known = random.random(len(white)) < 0.8
    direct = whiten(table)[known].T @ white[known]
    np.testing.assert_allclose(table.T @ whitener.back(white * known[:, None], past=past), direct, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("order", [NOISE.noise_order, 3 * NOISE.noise_order])
def test_errors_in_the_middle_of_recordings_become_white(order):
    """Products by the number of rows of each lag make them seem foreseeable, at worst without any innovation."""
    random, t = np.random.default_rng(1), np.arange(400)
    errors = [20.0 * (-1) ** k * np.exp(-(((t - 200) / 80) ** 2)) + random.normal(0, 0.5, len(t)) for k in range(6)]
    whitener = Whitener.of(errors, order)
    assert 0.7 < np.concatenate([whitener.apply(each) for each in errors]).std() < 1.3
