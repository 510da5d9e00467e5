"""States that are on or off, and their rhythm."""

import numpy as np
import pytest
from scipy.signal import lfilter

from acqd.discrepancy.residual.whitening import Whitener
from acqd.discrepancy.selection.detectors.switching import rhythm, search, walks
from tests.builders import STEP


def test_on_and_off_are_found_in_coloured_noise():
    random = np.random.default_rng(4)
    noise = [lfilter([0.3], [1, -0.8], random.normal(0, 1, 1500)) for _ in range(6)]
    true = [((np.arange(1500) + 170 * k) % 400) < 150 for k in range(6)]
    states = search([n + 3.0 * on for n, on in zip(noise, true, strict=True)], Whitener.of(noise))
    assert states is not None and states.size == pytest.approx(3.0, rel=0.1)
    assert np.mean([(a == b).mean() for a, b in zip(states.on, true, strict=True)]) > 0.98
    none = search(noise, Whitener.of(noise))
    assert none is None or none.gain < 0.1 * states.gain


def test_a_rhythm_is_told_from_bursts():
    t = [100.0 * k + STEP * np.arange(1500) for k in range(20)]
    steady = [((each + 3) % 37) < 15 for each in t]
    random = np.random.default_rng(7)
    bursts = [np.repeat(random.random(30) < 0.3, 50) for _ in t]
    period, regular = rhythm(steady, t)
    assert period == pytest.approx(37, rel=0.05) and regular > 0.8
    assert rhythm(bursts, t)[1] < 0.3


def test_a_walk_is_no_switching_load():
    random = np.random.default_rng(5)
    walk = [np.cumsum(random.normal(0, 0.3, 2000)) + random.normal(0, 0.5, 2000) for _ in range(4)]
    assert walks(walk, [each > np.median(each) for each in walk], 500)
    on = [(np.arange(2000) // 300) % 2 == 1 for _ in range(4)]
    load = [3.0 * state + random.normal(0, 0.5, 2000) for state in on]
    assert not walks(load, on, 500)
