"""The rhythm of states that are on or off."""

import numpy as np
import pytest

from acqd.discrepancy.selection.detectors.rhythm import rhythm
from tests.builders import STEP

DAY_S = 86_400.0


def _bursts(t: np.ndarray, seed: int) -> np.ndarray:
    """Equipment in use: on for 3 to 15 s, off for 8 to 60 s."""
    random = np.random.default_rng(seed)
    dwell = np.stack([random.uniform(8, 60, 200), random.uniform(3, 15, 200)], axis=1).ravel()
    return np.searchsorted(np.cumsum(dwell), t - t[0], side="right") % 2 == 1


def test_a_rhythm_has_its_period():
    t = [100.0 * k + STEP * np.arange(1500) for k in range(20)]
    regular = rhythm([((each + 3) % 37) < 15 for each in t], t)
    assert regular.period_s == pytest.approx(37, rel=0.05) and regular.probability > 0.95


def _thermostat(t: np.ndarray, seed: int) -> np.ndarray:
    """A heater with a period of 25 to 90 s whose dwell times scatter by 10 %."""
    random = np.random.default_rng(seed)
    period, duty = random.uniform(25, 90), random.uniform(0.3, 0.65)
    dwell = random.gamma(100.0, np.tile([period * (1 - duty), period * duty], 60) / 100.0)
    return np.searchsorted(np.cumsum(dwell), random.uniform(0, period) + t - t[0], side="right") % 2 == 1


def test_probabilities_of_a_rhythm_are_right_as_often_as_they_say_in_short_recordings():
    """Five minutes hold few cycles: what is said with 90 % is right in 90 %, and the rest says that it is open."""
    t = [90.0 * k + STEP * np.arange(1500) for k in range(5)]
    together = np.concatenate(t)
    said, regular = [], []
    for seed in range(25):
        for drawn in (_bursts, _thermostat):
            said.append(rhythm(np.split(drawn(together, seed), 5), t).probability)
            regular.append(drawn is _thermostat)
    said, regular = np.array(said), np.array(regular)
    assert np.mean((said > 0.5) == regular) > 0.85
    sure = np.abs(said - 0.5) > 0.4
    assert sure.mean() > 0.5 and np.mean((said > 0.5)[sure] == regular[sure]) > 0.9


@pytest.mark.parametrize("days", [1, 150])
def test_days_between_two_sessions_change_nothing(days):
    first = [100.0 * k + STEP * np.arange(1500) for k in range(10)]
    later = [each + 3_000.0 for each in first]
    on = [((each + 3) % 37) < 15 for each in [*first, *later]]
    moved = [each + days * DAY_S for each in later]
    apart, together = rhythm(on, [*first, *moved]), rhythm(on, [*first, *later])
    assert apart.period_s == pytest.approx(together.period_s) and min(apart.probability, together.probability) > 0.95


def _states(t, switchings):
    return [np.searchsorted(switchings, each, side="right") % 2 == 1 for each in t]


T = [72.0 * k + STEP * np.arange(1500) for k in range(3)]


def test_two_exact_cycles_are_a_rhythm_and_noise_does_not_hide_it():
    on = _states(T, [0.0, 26.4, 78.8, 109.7, 161.8, 192.2])
    assert rhythm(on, T).period_s == pytest.approx(83, rel=0.03) and rhythm(on, T).probability > 0.95
    on[1][1000:1030] ^= True
    on[2][300:350] ^= True
    assert rhythm(on, T).probability > 0.9


def test_uneven_stays_are_no_rhythm_and_a_single_cycle_says_nothing():
    assert rhythm(_states(T, [5.0, 30.0, 46.0, 94.0, 108.0, 120.0, 155.0, 190.0, 200.0]), T).probability < 0.2
    assert 0.2 < rhythm(_states(T, [40.0, 120.0]), T).probability < 0.8


def test_states_of_an_hour_have_a_rhythm_and_their_period():
    t = [np.arange(0, 8 * 3600, 1.0)]
    slow = rhythm(_states(t, np.cumsum([600, *[1200, 2400] * 8])), t)
    assert slow.probability > 0.95 and slow.period_s == pytest.approx(3600, rel=0.05)
