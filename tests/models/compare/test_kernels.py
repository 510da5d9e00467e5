"""Kernels of convolutions."""

import numpy as np
import pytest

from acqd.models.compare.kernels import difference_of_gaussian, laplacian_of_gaussian, likeness, response
from tests.models.motions import STEP


def test_known_kernels_are_recognised():
    assert np.allclose(difference_of_gaussian(3), np.array([-1, 0, 1]) / np.sqrt(2))
    assert np.allclose(laplacian_of_gaussian(3), np.array([1, -2, 1]) / np.sqrt(6))
    for length in (3, 5, 11, 21):
        first, second = difference_of_gaussian(length), laplacian_of_gaussian(length)
        assert abs(first @ second) < 1e-12
        assert likeness(-3 * first).name == "velocity" and likeness(second).name == "acceleration"
        assert likeness(np.ones(length)).name == "angle"
        assert response(first, STEP)[1][0] < 1e-12  # no response to standstill
    f, magnitude = response(np.array([-0.5, 0.0, 0.5]) / STEP, STEP)
    assert magnitude[10] == pytest.approx(np.sin(2 * np.pi * f[10] * STEP) / STEP)
