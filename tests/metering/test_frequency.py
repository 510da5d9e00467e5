"""Mains frequency from one window."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering.frequency import FrequencyEstimator
from tests.mains import EN50160, make_mains

ENDS = np.arange(1000, 80_000, 800)


def estimate(mains, phases, rate=20_000.0, span=1000):
    u = mains.codes[:, 0 : 2 * phases : 2].T.astype(np.float64)
    ends = np.arange(span, u.shape[1], int(0.04 * rate))
    return FrequencyEstimator(rate, span).estimate(u, ends)


@pytest.mark.parametrize("phases", [1, 3])
@pytest.mark.parametrize("f", [45.0, 49.5, 49.99, 50.0, 50.37, 51.0, 59.5, 60.5, 65.0])
def test_within_10_mhz_with_en50160_harmonics_noise_and_dc(f, phases):
    mains = make_mains(f, harmonics=EN50160, noise=0.001, dc=0.01, phases=phases)
    assert np.abs(estimate(mains, phases) - f).max() < 0.010


@settings(max_examples=25)
@given(f=st.floats(45.0, 65.0), rate=st.sampled_from([2_000.0, 5_760.0, 10_000.0, 44_100.0]))
def test_any_frequency_at_any_rate(f, rate):
    mains = make_mains(f, rate=rate, seconds=0.5, phases=1, harmonics={3: 0.05, 5: 0.06})
    assert np.abs(estimate(mains, 1, rate, int(0.05 * rate)) - f).max() < 0.005


def test_follows_a_frequency_that_drifts():
    rate, slope = 20_000.0, 0.5
    t = np.arange(80_000) / rate
    u = 10_000 * np.cos(2 * np.pi * (49.0 * t + slope * t * t / 2))[None]
    f = FrequencyEstimator(rate, 1000).estimate(u, ENDS)
    centres = (ENDS - 500) / rate
    assert np.abs(f - (49.0 + slope * centres)).max() < 0.002


def test_finds_the_mains_again_after_a_jump_of_frequency():
    u = np.concatenate([make_mains(f, seconds=2).codes[:, 0] for f in (50.0, 47.0)]).astype(float)[None]
    f = FrequencyEstimator(20_000.0, 1000).estimate(u, ENDS)
    assert abs(f[5] - 50.0) < 0.01 and np.abs(f[-40:] - 47.0).max() < 0.01


@pytest.mark.parametrize("kind", ["zero", "noise", "dc", "too slow"])
def test_says_unknown_where_there_are_no_mains(kind):
    t = np.arange(8_000) / 20_000.0
    u = {
        "zero": np.zeros(8_000),
        "noise": np.random.default_rng(1).normal(0, 100, 8_000),
        "dc": np.full(8_000, 5_000.0),
        "too slow": 10_000 * np.cos(2 * np.pi * 16.7 * t),
    }[kind][None]
    ends = np.arange(1000, 8_000, 800)
    assert np.isnan(FrequencyEstimator(20_000.0, 1000).estimate(u, ends)).all()


def test_a_dead_phase_does_not_disturb_the_others():
    mains = make_mains(50.2)
    mains.codes[:, 2] = np.random.default_rng(0).integers(-2, 3, len(mains.codes))
    assert np.abs(estimate(mains, 3) - 50.2).max() < 0.001
