"""States that are on or off."""

import numpy as np
import pytest
from scipy.signal import lfilter

from acqd.discrepancy.loads.switching import search, walks
from acqd.residual.whitening import Whitener


def test_on_and_off_are_found_in_coloured_noise():
    random = np.random.default_rng(4)
    noise = [lfilter([0.3], [1, -0.8], random.normal(0, 1, 1500)) for _ in range(6)]
    true = [((np.arange(1500) + 170 * k) % 400) < 150 for k in range(6)]
    states = search([n + 3.0 * on for n, on in zip(noise, true, strict=True)], Whitener.of(noise))
    assert states is not None and states.size == pytest.approx(3.0, rel=0.1)
    assert np.mean([(a == b).mean() for a, b in zip(states.on, true, strict=True)]) > 0.98
    none = search(noise, Whitener.of(noise))
    assert none is None or none.gain < 0.1 * states.gain


def test_a_walk_is_no_switching_load():
    random = np.random.default_rng(5)
    walk = [np.cumsum(random.normal(0, 0.3, 2000)) + random.normal(0, 0.5, 2000) for _ in range(4)]
    assert walks(walk, [each > np.median(each) for each in walk], 500)
    on = [(np.arange(2000) // 300) % 2 == 1 for _ in range(4)]
    load = [3.0 * state + random.normal(0, 0.5, 2000) for state in on]
    assert not walks(load, on, 500)
