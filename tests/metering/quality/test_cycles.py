"""f, ROCOF and phase jumps of 10/12-cycle intervals."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.metering.quality.waves import T0, metered, of_kind, three_phases

RATE = 20_000.0
t = np.arange(int(3 * RATE)) / RATE


@pytest.mark.parametrize("slope", [-1.0, 0.2, 3.0])
def test_f_of_a_ramp_is_that_of_the_middle_and_its_slope_the_rocof(slope):
    values = of_kind(metered(three_phases(2 * np.pi * (50 * t + slope * (t * t / 2 - t)))))
    assert len(values) >= 13
    for one in values:
        middle = (one.utc_ns - T0) * 1e-9 + one.duration / 2
        assert one.f == pytest.approx(50 + slope * (middle - 1), abs=1e-3)
        assert one.rocof == pytest.approx(slope, abs=0.01)
        assert not one.flags
        assert one.phase["Vrms"] == pytest.approx(230, rel=1e-4)  # no whole number of half cycles while f changes


@pytest.mark.parametrize("f", [42.5, 47.1, 57.5])
def test_the_range_of_class_a(f):
    values = of_kind(metered(three_phases(2 * np.pi * f * t[:20_000])))
    assert len(values) >= 4 and all(abs(one.f - f) < 1e-4 for one in values)


def test_twelve_cycles_at_60_hz():
    values = of_kind(metered(three_phases(2 * np.pi * 59.9 * t[:20_000]), f_nominal=60.0))
    assert len(values) == 4 and all(abs(one.duration - 12 / 59.9) < 1e-6 for one in values)
    assert of_kind(metered(three_phases(2 * np.pi * 69 * t[:20_000]), f_nominal=60.0))[0].f == pytest.approx(69)


def test_no_wrong_f_after_a_phase_jump():
    random = np.random.default_rng(3)
    flagged = 0
    for _ in range(12):
        at, f = random.uniform(0.4, 0.8), random.uniform(49, 51)
        jump = np.radians(random.uniform(5, 60)) * random.choice([-1, 1])
        angle = 2 * np.pi * f * t[:24_000] + jump * (t[:24_000] > at)
        x = three_phases(angle) + random.normal(0, 0.1, (24_000, 6))
        values = of_kind(metered(x))
        flagged += sum("transient" in one.flags for one in values)
        assert all(abs(one.f - f) < 0.01 for one in values)
    assert 12 <= flagged <= 24


@pytest.mark.parametrize("between", [60.0, 72.0, 175.0])
def test_an_interharmonic_of_two_percent_moves_f_by_less_than_5_mhz(between):
    x = three_phases(2 * np.pi * 50.02 * t)
    x[:, 0::2] += 0.02 * 230 * np.sqrt(2) * np.cos(2 * np.pi * between * t)[:, None]
    for one in of_kind(metered(x)):
        assert one.f == pytest.approx(50.02, abs=5e-3)


@pytest.mark.parametrize("between", [45.5, 54.5, 57.0, 62.0])
def test_f_that_an_interharmonic_of_positive_sequence_moves_is_flagged(between):
    x = three_phases(2 * np.pi * 50.02 * t) + 0.02 * three_phases(2 * np.pi * between * t)
    for one in of_kind(metered(x)):
        assert abs(one.f - 50.02) < 0.01 or "transient" in one.flags


def test_noise_has_no_frequency():
    x = np.random.default_rng(0).normal(0, 200, (30_000, 6))
    values = of_kind(metered(x))
    assert len(values) >= 6
    assert all(np.isnan(one.f) and "transient" in one.flags for one in values)
    for one, following in itertools.pairwise(values):
        assert following.utc_ns - one.utc_ns == pytest.approx(0.2e9, abs=10)
