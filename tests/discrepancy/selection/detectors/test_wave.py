"""Sines in the residual."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from acqd.discrepancy.selection.detectors import wave
from acqd.residual.whitening import Whitener

ROWS = [900, 700, 820]


def coloured(random, rows):
    """Noise that remembers some rows, as the levels of supplies do."""
    return lfilter([1.0], [1.0, -0.8], random.normal(0, 0.5, rows + 100))[100:]


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 999), st.floats(20, 250), st.sampled_from([1.0, 3.0, 30.0]))
def test_a_sine_in_coloured_noise_has_its_period_and_its_phases(seed, rows, amplitude):
    random = np.random.default_rng(seed)
    quiet = [coloured(random, length) for length in ROWS]
    phases = random.uniform(0, 2 * np.pi, len(ROWS))
    sines = [np.cos(2 * np.pi * np.arange(n) / rows + phase) for n, phase in zip(ROWS, phases, strict=True)]
    whitener = Whitener.of(quiet, 10)
    swinging = wave.search([amplitude * s + q for s, q in zip(sines, quiet, strict=True)], whitener)
    assert swinging is not None and swinging.rows == pytest.approx(rows, rel=0.08)
    columns = [each[:, 0] for each in swinging.columns(ROWS)]
    alike = [float(c @ s / np.sqrt((c @ c) * (s @ s))) for c, s in zip(columns, sines, strict=True)]
    assert min(alike) > (0.7 if amplitude == 1.0 else 0.85)


def test_noise_gains_no_more_than_was_searched_for():
    gains = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        quiet = [coloured(random, length) for length in ROWS]
        found = wave.search(quiet, Whitener.of(quiet, 10))
        paid = np.log(found.tried) + len(ROWS) * np.log(sum(ROWS))
        gains.append(found.gain - paid)
    assert max(gains) < 0


def test_less_than_the_fewest_periods_is_no_wave():
    """A fraction of a period is a curve like any other."""
    quiet = [np.random.default_rng(k).normal(0, 1, 600) for k in range(3)]
    slow = [10 * np.cos(2 * np.pi * np.arange(600) / 1200) + each for each in quiet]
    found = wave.search(slow, Whitener.of(quiet, 10))
    assert found is not None and found.rows <= 300
    assert wave.search([each[:12] for each in quiet], Whitener.of(quiet, 10)) is None


def test_without_segments_nothing_swings():
    assert wave.search([], Whitener.of([np.random.default_rng(0).normal(0, 1, 300)], 10)) is None
