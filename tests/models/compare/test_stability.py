"""Oscillations of a prediction, and the noise floor."""

import json
from dataclasses import replace

import numpy as np
import pytest

from acqd.models.compare.stability import unstable_share
from acqd.models.metrics import measure
from acqd.models.noise_floor import noise_floor
from tests.models.motions import STEP, angles, iiwa_power, segment


def test_oscillation_and_noise_are_told_apart():
    q = angles(600, 7, 1)
    P = iiwa_power(q, seed=2)
    one = segment(1, "test", q, P)
    assert unstable_share([P + 0.5], [one]) == 0.0
    wild = P.copy()
    wild[300:400] += 15 * (-1.0) ** np.arange(100)
    assert unstable_share([wild], [one]) == pytest.approx(100 / 600, abs=0.03)
    still = replace(one, q=np.zeros_like(q), P=200 + np.random.default_rng(1).normal(0, 2.0, 600))
    floor, where = noise_floor([still], STEP)
    assert floor == pytest.approx(2.0, rel=0.1) and where == "at rest, within two seconds"
    assert json.loads(json.dumps(measure([P], [one]).as_json()))["mae"] == 0.0
