"""Figures of merit."""

import numpy as np

from acqd.models.metrics import measure
from tests.models.motions import segment


def test_bias_counts_against_r2():
    P = np.random.default_rng(1).normal(100, 5, 400)
    one = segment(1, "test", np.zeros((400, 7)), P)
    assert measure([P], [one]).r2 == 1.0 and measure([P + 30], [one]).r2 < -20
