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
    assert rhythm([((each + 3) % 37) < 15 for each in t], t) == pytest.approx(37, rel=0.05)


def test_equipment_in_use_has_no_rhythm_even_in_short_recordings():
    t = [90.0 * k + STEP * np.arange(1500) for k in range(5)]
    together = np.concatenate(t)
    named = 0
    for seed in range(30):
        on = _bursts(together, seed)
        named += rhythm(np.split(on, 5), t) is not None
    assert named <= 5


@pytest.mark.parametrize("days", [1, 150])
def test_days_between_two_sessions_change_nothing(days):
    first = [100.0 * k + STEP * np.arange(1500) for k in range(10)]
    later = [each + 3_000.0 for each in first]
    on = [((each + 3) % 37) < 15 for each in [*first, *later]]
    moved = [each + days * DAY_S for each in later]
    assert rhythm(on, [*first, *moved]) == pytest.approx(rhythm(on, [*first, *later]))
