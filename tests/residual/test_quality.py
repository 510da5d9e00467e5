"""Figures of merit and the noise floor."""

import numpy as np
import pytest

from acqd.models.noise_floor import noise_floor
from acqd.residual.quality import quality
from acqd.residual.residuals import about_means, rms
from tests.builders import STEP, recording


def test_the_noise_floor_is_that_of_a_resting_arm(model):
    resting = [recording(model, k, seed=4, rows=2000) for k in range(4)]
    floor, where = noise_floor(resting, STEP)
    assert where.startswith("at rest")
    assert floor == pytest.approx(0.25 / np.sqrt(1 - 0.49), rel=0.3)


def test_quality_of_white_and_of_foreseeable_residuals():
    random = np.random.default_rng(1)
    white = quality([random.normal(1.0, 2.0, 5000)])
    assert white.rmse == pytest.approx(np.sqrt(5), rel=0.05) and white.bias == pytest.approx(-1, abs=0.1)
    assert white.residual_autocorrelation < 0.03
    assert quality([np.cumsum(random.normal(0, 1, 5000))]).residual_autocorrelation > 0.8


def test_a_drift_of_the_standby_power_is_not_in_the_error_about_the_means():
    random = np.random.default_rng(2)
    fast = random.normal(0, 1.0, 6000)
    drifting = [fast + np.repeat([0.0, 5.0, -3.0, 8.0], 1500)]
    assert rms(drifting) > 4 and rms(about_means(drifting)) == pytest.approx(1.0, rel=0.05)
    assert sum(len(each) for each in about_means(drifting)) == 6000
