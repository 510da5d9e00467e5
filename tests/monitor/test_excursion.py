"""The p-value of a residual: large for unchanged ones, whatever drifts a little, tiny for changes."""

import numpy as np
import pytest

from acqd.monitor.cusum import Baseline
from acqd.monitor.excursion import cusum, largest_excursion, without_level
from acqd.monitor.thresholds import MONITOR
from tests.monitor.test_cusum import STEP, recordings

BETWEEN_S = 3600 * 200.0
RANGE_W = 100.0


def excursion(seed, *, drift=0.0, begins=0, **change):
    """A change of recordings of a minute each after some without it."""
    random = np.random.default_rng(seed)
    errors, predicted = recordings(random, 30)
    baseline = Baseline.of(errors, predicted, [60.0 * k for k in range(30)], STEP, BETWEEN_S, without_level)
    before, same = recordings(random, begins) if begins else ([], [])
    after, moved = recordings(random, 30, **change)
    rows = [
        (e + drift, p, 1e6 + 60 * k) for k, (e, p) in enumerate(zip([*before, *after], [*same, *moved], strict=True))
    ]
    return largest_excursion(baseline, BETWEEN_S, RANGE_W, rows, STEP)


def test_unchanged_residuals_have_large_p_values():
    p = np.array([excursion(seed).p for seed in range(20)])
    assert (p < 0.05).sum() <= 2 and (p < 0.005).sum() == 0


def test_a_drift_of_standby_below_two_percent_of_the_range_is_no_change():
    assert excursion(1, drift=1.5).p > 0.05
    assert excursion(1, drift=4.0).p < 1e-6


@pytest.mark.parametrize("change", [{"size": 2.0}, {"level": 6.0}, {"level": -6.0}])
def test_a_change_has_a_tiny_p_value_and_an_onset(change):
    found = excursion(5, begins=20, **change)
    assert found.p < 1e-6 and found.height > 1
    assert found.onset_s == pytest.approx(1e6 + 20 * 60, abs=120)


def test_an_error_that_is_a_little_larger_on_new_motions_is_no_change():
    assert excursion(2, size=1.15).p > 0.05


def test_cusum_is_pages_recursion():
    values = np.random.default_rng(0).normal(0.5, 2, 200)
    sums, total = [], 0.0
    for value in values:
        total = max(0.0, total + value - MONITOR.cusum_slack)
        sums.append(total)
    assert cusum(values) == pytest.approx(np.array(sums))


def test_without_whole_blocks_there_is_no_excursion():
    random = np.random.default_rng(0)
    errors, predicted = recordings(random, 30)
    baseline = Baseline.of(errors, predicted, [60.0 * k for k in range(30)], STEP, BETWEEN_S, without_level)
    assert largest_excursion(baseline, BETWEEN_S, RANGE_W, [(errors[0][:20], predicted[0][:20], 0.0)], STEP) is None
