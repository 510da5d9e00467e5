"""What a verdict may say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.verdict import grown
from tests.builders import grey, recording


def test_an_error_beyond_that_of_the_reference_has_grown():
    model = grey()
    reference = [recording(model, k, rows=60) for k in range(8)]
    new = [recording(model, k, rows=60, seed=3) for k in range(4)]
    random = np.random.default_rng(1)
    usual = [random.normal(0, 6.1, 60) for _ in reference]
    assert grown(new, [random.normal(0, 11.6, 60) for _ in new], reference, usual)
    assert not grown(new, [random.normal(0, 6.1, 60) for _ in new], reference, usual)
    assert not grown(new, [random.normal(0, 11.6, 60) for _ in new], [], [])
    one_stop = [random.normal(0, 6.1, 60) for _ in new]
    one_stop[0] = one_stop[0] * 10
    assert not grown(new, one_stop, reference, usual)


@given(st.floats(0.7, 1.4), st.floats(0.0, 0.1), st.floats(0.1, 20), st.floats(0, 2))
def test_true_units(scale, deviation, value, half):
    true, wide = TorqueScale(scale, deviation).corrected(value, half, "kg")
    assert true == pytest.approx(value / scale)
    assert wide >= half / scale * (1 - 1e-9)
    assert wide >= 1.96 * deviation / scale * true * (1 - 1e-9)
    assert TorqueScale(scale, deviation).corrected(value, half, "W") == (value, half)


def test_a_torque_sensor_needs_no_correction():
    sensor = TorqueScale(1.0, 0.02)
    assert sensor.corrected(3.0, 0.3, "Nm")[0] == 3.0
    assert replace(sensor, value=0.9).corrected(1.0, 0.0, "W/Nm^2")[0] == pytest.approx(0.81)
