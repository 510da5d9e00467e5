"""Transients of known voltages (simulated): found with their time, size and kind; changes of the voltage are none."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering.quality.detector import EventDetector
from acqd.metering.quality.event import Thresholds
from acqd.metering.quality.reference import Declared
from tests.metering.quality.disturbed import RATE, blocks, form, voltages

LIMITS = Thresholds(transient=0.2)
PEAK = 230 * np.sqrt(2)


def transients(u, limits=LIMITS, cuts=None):
    detector = EventDetector(form(u.shape[1]), Declared(230.0), limits)
    events = [event for block in blocks(u, cuts) for event in detector.feed(block)]
    assert all(event.end is not None for event in events if event.kind == "transient")
    return [event for event in events if event.kind == "transient"]


def steady(f=50.07, seconds=1.5):
    return voltages(lambda t, _: 1.0 + 0 * t, f=f, seconds=seconds)


@pytest.mark.parametrize("at", [0.7, 0.7051, 0.712])
def test_an_impulse_of_one_phase(at):
    u, t = steady(), np.arange(round(1.5 * RATE)) / RATE
    u[:, 1] += 0.6 * PEAK * np.exp(-((t - at) ** 2) / (2 * 2e-4**2))
    (event,) = transients(u)
    assert event.phases == (1,) and event.flags == frozenset({"impulsive"})
    assert event.extreme == pytest.approx(0.6 * PEAK, rel=0.03) and event.reference == 230
    assert event.utc_ns * 1e-9 == pytest.approx(at, abs=5e-4) and 2e-4 < event.duration < 1e-3


def test_ringing_of_a_capacitor_that_is_switched():
    u, t = steady(), np.arange(round(1.5 * RATE)) / RATE
    late = np.maximum(t - 0.8, 0)
    ring = 0.7 * PEAK * np.sin(2 * np.pi * 700 * late) * np.exp(-late / 2e-3) * (t >= 0.8)
    (event,) = transients(u + ring[:, None])
    assert event.phases == (0, 1, 2) and event.flags == frozenset({"oscillatory"}) and event.duration < 0.01


@pytest.mark.parametrize("share", [0.3, 0.6, 0.75, 1.3])
@pytest.mark.parametrize("at", np.linspace(0.7, 0.72, 5))
def test_a_dip_or_swell_is_no_transient(share, at):
    u = voltages(lambda t, _: np.where((t > at) & (t < at + 0.2), share, 1.0), f=49.9, seconds=1.3)
    assert transients(u) == []


def test_a_phase_jump_wandering_f_noise_harmonics_and_notches_are_no_transients():
    t = np.arange(round(2 * RATE)) / RATE
    angle = 2 * np.pi * (49.8 * t + 0.3 * t * t) + 0.9 * (t > 1.2)
    u = np.column_stack(
        [PEAK * (np.sin(a) + 0.06 * np.sin(5 * a)) for a in (angle - 2 * np.pi * k / 3 for k in range(3))]
    )
    u += np.random.default_rng(0).normal(0, 2, u.shape)
    assert transients(u) == []
    notched = steady(f=50.0)
    notched[np.arange(len(notched)) % 200 < 4] *= 0.3  # of a rectifier: in every cycle at the same place
    assert transients(notched) == []


def test_without_a_word_there_are_none_and_blocks_may_be_of_any_length():
    u, t = steady(), np.arange(round(1.5 * RATE)) / RATE
    u[:, 0] += 0.6 * PEAK * np.exp(-((t - 0.9) ** 2) / (2 * 2e-4**2))
    assert transients(u, Thresholds()) == []
    (one,), (other,) = transients(u), transients(u, cuts=[3_000, 8_990, 9_001, 9_003, 12_000])
    assert one.begin == other.begin and one.extreme == pytest.approx(other.extreme, rel=1e-2)


def test_a_threshold_that_noise_would_cross_is_refused():
    with pytest.raises(ValueError, match="transients: expected a threshold from 5 to 300 %"):
        Thresholds(transient=0.01)
