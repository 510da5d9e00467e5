"""Speed and acceleration by differences."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acqd.models.features import continued, lead_in, motion, padded
from tests.models.motions import STEP


@given(st.floats(-3, 3), st.floats(-2, 2), st.floats(-5, 5))
def test_differences_are_exact_for_parabolas(a, b, c):
    t = np.arange(20) * STEP
    _, qd, qdd = motion((a + b * t + c * t**2)[:, None], STEP)
    assert np.allclose(qd[1:-1, 0], (b + 2 * c * t)[1:-1], atol=1e-9)
    assert np.allclose(qdd[1:-1, 0], 2 * c, atol=1e-7)


@given(st.floats(-3, 3), st.floats(0.3, 2), st.floats(0, 5), st.booleans())
def test_a_recording_that_begins_or_ends_in_motion_goes_on_with_its_acceleration(a, b, c, backwards):
    t = np.arange(20) * STEP
    q = (a + b * t + c * t**2)[:, None]
    q = q[::-1] if backwards else q
    _, _, qdd = motion(q, STEP)
    moving = slice(None, -1) if backwards else slice(1, None)  # at the slow end it may stop rather than turn
    assert np.allclose(qdd[moving, 0], 2 * c, atol=1e-7)


def test_a_recording_that_begins_and_ends_at_rest_rests_beyond():
    q = np.cos(np.minimum(np.arange(40), 25) * 0.1)[:, None] + np.zeros((1, 2))
    q[:3] = q[0]
    np.testing.assert_array_equal(continued(q, 5), padded(q, 5))
    assert len(lead_in(q)) == 0 < len(lead_in(q[10:]))
    assert np.ptp(continued(q[10:20], 40)[:, 0]) < 2.0  # the motion fades
