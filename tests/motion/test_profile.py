"""Profiles of one motion: their limits, their end."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.motion.profile import fastest_profile

positive = st.floats(0.05, 5.0)


@given(st.lists(st.floats(-3, 3).filter(lambda x: abs(x) > 1e-4), min_size=1, max_size=7), positive, positive)
@settings(max_examples=60)
def test_a_profile_keeps_its_limits_and_arrives(distance, speed, acceleration):
    distance = np.array(distance)
    profile = fastest_profile(distance, np.full(len(distance), speed), np.full(len(distance), acceleration))
    t = np.linspace(0, profile.duration, 2001)
    s, sd, sdd = profile.at(t)
    assert s[0] == 0 and s[-1] == pytest.approx(1.0, abs=1e-9)
    assert (np.diff(s) >= -1e-12).all()
    largest = np.abs(distance).max()
    assert (sd * largest).max() <= speed * (1 + 1e-6)
    assert np.abs(sdd * largest).max() <= acceleration * (1 + 1e-6)
    assert sd[-1] == pytest.approx(0, abs=1e-9) and sdd[-1] == pytest.approx(0, abs=1e-6)
    # one limit is used to the full: nothing faster exists without the smoothing
    used = max((sd * largest).max() / speed, np.abs(sdd * largest).max() / acceleration)
    assert used > 0.999 or profile.smoothing > profile.ramp
