"""The mean of an f that walks within two cycles, and `Agreement`, which compares it with f."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering.agreement import Agreement
from acqd.metering.walk import mean_weights

RATE, F0 = 20_000.0, 50.0
END = np.linspace(400.0, 1_200.0, 7)
EDGES = np.stack((END - 400.0, END))


def phases_of(f_off):
    """Means of the phase [rad] over the cycles, of what f is off from the trial at each sample [Hz]."""
    turns = np.concatenate(([0.0], np.cumsum(f_off) / RATE))
    total = np.concatenate(([0.0], np.cumsum((turns[1:] + turns[:-1]) / 2)))
    begin, end = (np.interp(each, np.arange(len(total)), total) for each in EDGES)
    return 2 * np.pi * (end - begin) / (EDGES[1] - EDGES[0])


@pytest.mark.parametrize("slope", [0.0, 1.0, -10.0])
def test_a_steady_f_is_exact_and_a_ramp_nearly(slope):
    f_off = 0.003 + slope * (np.arange(1_200) + 0.5) / RATE
    weights = mean_weights(EDGES, 400.0, 1_200.0, RATE)
    assert weights @ phases_of(f_off) == pytest.approx(f_off[400:].mean(), abs=abs(slope) * 4e-3 + 1e-6)


@pytest.mark.parametrize(("at", "seen"), [(500, 0.95), (800, 0.95), (1_000, 0.7), (1_100, 0.4)])
def test_a_step_is_followed_the_less_the_later_it_is(at, seen):
    f_off = np.where(np.arange(1_200) >= at, 0.3, 0.0)
    weights = mean_weights(EDGES, 400.0, 1_200.0, RATE)
    share = weights @ phases_of(f_off) / f_off[400:].mean()
    assert seen < share < 1.05


def test_what_is_usual_for_a_stream_is_no_doubt_and_more_is():
    agreement, random = Agreement(), np.random.default_rng(1)
    noisy = [agreement.note(50.0, apart) for apart in 0.003 * random.standard_normal(500)]
    assert np.mean(noisy[5:]) < 0.005
    assert agreement.note(50.0, 0.018) and not agreement.note(50.0, float("nan"))
    calm = Agreement()
    assert not any(calm.note(50.0, 0.0005) for _ in range(50)) and calm.note(50.0, 0.009)
