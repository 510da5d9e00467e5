"""Symmetrical components, unbalance and apparent powers against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.metering.quality.apparent import arithmetic_apparent, effective_apparent
from acqd.metering.quality.components import rotation, symmetrical, unbalance

A = np.exp(2j * np.pi / 3)
complex_numbers = st.builds(complex, st.floats(-300, 300), st.floats(-300, 300))


@given(complex_numbers, complex_numbers, complex_numbers)
def test_components_are_what_the_phasors_were_made_of(zero, positive, negative):
    phases = np.array([zero + positive + negative, zero + A**2 * positive + A * negative,
                       zero + A * positive + A**2 * negative])  # fmt: skip
    assert symmetrical(phases) == pytest.approx(np.array([zero, positive, negative]), abs=1e-9)


def test_unbalance_of_magnitudes_as_iec_61000_4_30_writes_it():
    """u2 = sqrt((1 - sqrt(3 - 6 b)) / (1 + sqrt(3 - 6 b))), b from the line-to-line voltages."""
    phases = np.array([230.0, 225.0 * A**2, 238.0 * A])
    lines = np.abs(phases - np.roll(phases, -1))
    beta = (lines**4).sum() / (lines**2).sum() ** 2
    root = np.sqrt(3 - 6 * beta)
    assert unbalance(phases)[0] == pytest.approx(100 * np.sqrt((1 - root) / (1 + root)))


def turning(phasors):
    return rotation(np.abs(symmetrical(phasors)).tolist())


def test_the_order_of_the_phases_is_said_where_it_is_clear():
    forward = np.array([1, A**2, A]) * 230
    assert turning(forward) == 1 and turning(forward[[0, 2, 1]]) == -1
    assert unbalance(forward[[0, 2, 1]])[0] == pytest.approx(0, abs=1e-9)
    assert np.isnan(turning(np.array([230.0, 0, 0]))) and np.isnan(turning(np.zeros(3, complex)))
    assert np.isnan(unbalance(np.zeros(3, complex))).all()


def test_effective_and_arithmetic_s_are_equal_where_balanced_and_differ_where_not():
    V = np.full(3, 230.0)
    lines, I = V * np.sqrt(3), np.full(3, 5.0)  # noqa: E741
    assert effective_apparent(V, lines, I, 0.0) == pytest.approx(arithmetic_apparent(V, I))
    one = np.array([15.0, 0, 0])  # all current in one phase returns through the neutral
    assert arithmetic_apparent(V, one) == pytest.approx(3450)
    assert effective_apparent(V, lines, one, 15.0) == pytest.approx(3 * 230 * 15 * np.sqrt(2 / 3))
