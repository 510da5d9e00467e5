"""Figures of a session."""

import numpy as np
import pytest

from acqd.lab.campaign.run_session import steady_error


def test_the_steady_error_sees_a_wrong_meter():
    power = 155 + 0.3 * np.random.default_rng(0).standard_normal(1000)
    assert steady_error(power, power * 1.002)["second_worst"] == pytest.approx(0.002)
    assert steady_error(np.linspace(0, 5000, 1000), np.linspace(0, 5000, 1000))["windows"] == 0
