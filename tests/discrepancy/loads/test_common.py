"""A load that switches in the reference, too."""

import numpy as np
import pytest

from acqd.discrepancy.loads.common import CommonLoad
from acqd.residual.whitening import Whitener


def _residuals(states):
    """[600] W of every recording: white noise, and 4 W while `states` are on."""
    random = np.random.default_rng(5)
    return [random.normal(0, 0.5, 600) + 4.0 * on for on in states]


def _whitener():
    return Whitener.of(_residuals([np.zeros(600)] * 8))


def test_a_load_goes_on_and_off_again():
    t = np.arange(600)
    residuals = _residuals([(t // 200) % 2, (t > 150) & (t < 420), np.zeros(600), t > 300])
    load = CommonLoad.of(residuals, _whitener())
    assert load is not None and load.size_W == pytest.approx(4.0, abs=0.2)
    assert load.power(residuals)[1][[100, 300, 500]] == pytest.approx([0.0, load.size_W, 0.0], abs=0.1)


def test_single_edges_are_no_load():
    t = np.arange(600)
    single = [t > 150, t < 420, t > 300, np.zeros(600), t < 200, t > 500]
    assert CommonLoad.of(_residuals(single), _whitener()) is None
