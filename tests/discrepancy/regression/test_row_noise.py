"""Noise that rises with the power."""

import numpy as np
import pytest

from acqd.discrepancy.regression.row_noise import rising_of, usual_noise
from acqd.discrepancy.regression.setup import Comparison, set_up
from tests.builders import recording


@pytest.mark.parametrize("draw", ["normal", "laplace"])
@pytest.mark.parametrize("share", [0.0, 0.05, 0.3])
def test_the_rise_is_the_share_by_which_the_power_is_wrong(share, draw):
    random = np.random.default_rng(1)
    power = random.standard_t(3, 20_000) * 5.0
    error = getattr(random, draw)(0.0, 1.0, len(power)) * usual_noise(share**2, power)
    error[::500] *= 40.0  # collisions
    assert np.sqrt(rising_of(error, power)) == pytest.approx(share, rel=0.15, abs=0.01)


def wrong_by_a_share(scene, random):
    """W: an error of a tenth of the power's change within two rows, in either direction."""
    return 0.1 * np.gradient(scene.predicted) * random.normal(0, 1, len(scene.predicted))


@pytest.mark.parametrize("error", [None, wrong_by_a_share])
def test_rows_of_fast_power_count_less_where_the_model_is_wrong_by_a_share(error, model, robot):
    before, after = ([recording(model, k, error, seed=seed) for k in range(4)] for seed in (1, 2))
    comparison = Comparison(model, robot, after, before, frozenset({"payload"}), frozenset())
    parts = set_up(comparison, lambda _: None).design.columns.parts
    loudest = max(float(np.max(part.noise) / np.median(part.noise)) for part in parts)
    assert loudest > 1.5 if error else loudest < 1.3
