"""Speed and acceleration by differences."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acqd.models.features import motion
from tests.models.motions import STEP


@given(st.floats(-3, 3), st.floats(-2, 2), st.floats(-5, 5))
def test_differences_are_exact_for_parabolas(a, b, c):
    t = np.arange(20) * STEP
    _, qd, qdd = motion((a + b * t + c * t**2)[:, None], STEP)
    assert np.allclose(qd[1:-1, 0], (b + 2 * c * t)[1:-1], atol=1e-9)
    assert np.allclose(qdd[1:-1, 0], 2 * c, atol=1e-7)
