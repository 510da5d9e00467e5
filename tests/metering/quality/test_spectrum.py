"""Harmonics and interharmonics against closed forms: within 0.1 % of the fundamental, mostly far better."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.metering.quality.resample import MARGIN
from acqd.metering.quality.spectrum import (
    harmonic_subgroups,
    interharmonic_subgroups,
    known_orders,
    line_squares,
    spectrum,
    thds,
)

U1 = 230.0


def lines_of(amplitudes, angles, f, rate, cycles, start):
    """Lines of a wave with RMS `amplitudes` [line] at multiples of f / cycles."""
    count = int(start + cycles * rate / f) + 3 * MARGIN * 30
    cell = np.arange(count) + 0.5 - start
    x = np.zeros(count)
    for k in np.flatnonzero(amplitudes):
        peak = amplitudes[k] * (np.sqrt(2) if k else 1.0)
        x += peak * np.cos(2 * np.pi * k * f / cycles / rate * cell + angles[k] * (k > 0))
    return spectrum(x[None], start, cycles * rate / f, cycles)


@settings(max_examples=25)
@given(
    st.floats(42.5, 69.0),
    st.sampled_from([7_812.5, 12_800.0, 20_000.0, 51_200.0, 250_000.0]),
    st.floats(0, 1),
    st.integers(0, 2**32 - 1),
)
def test_groups_are_those_of_the_wave(f, rate, shift, seed):
    random = np.random.default_rng(seed)
    cycles = 12 if f > 57.5 else 10
    known = known_orders(rate, f)
    lines = cycles * known
    amplitudes = np.zeros(51 * cycles + 1)
    amplitudes[:lines] = 0.002 * U1 * random.random(lines) * (random.random(lines) < 0.1)
    amplitudes[cycles * np.arange(2, known)] = 0.05 * U1 * random.random(known - 2)
    amplitudes[cycles] = U1
    angles = random.uniform(0, 2 * np.pi, len(amplitudes))
    found = lines_of(amplitudes, angles, f, rate, cycles, 40.0 * MARGIN + shift)
    squares = np.append(amplitudes**2, np.zeros(cycles))
    for n in range(1, known):
        at = n * cycles
        assert (
            abs(harmonic_subgroups(line_squares(found, cycles))[0, n - 1] - np.sqrt(squares[at - 1 : at + 2].sum()))
            < 1e-4 * U1
        )
        inner = squares[at + 2 : at + cycles - 1].sum()
        if n + 1 < known:
            assert abs(interharmonic_subgroups(line_squares(found, cycles))[0, n] - np.sqrt(inner)) < 1e-4 * U1
    wanted = angles[cycles] if angles[cycles] < np.pi else angles[cycles] - 2 * np.pi
    assert abs(np.angle(found[0, cycles] * np.exp(-1j * wanted))) < 1e-4
    assert abs(found[0, 0].real - amplitudes[0]) < 1e-4 * U1


def test_an_independent_dft_gives_the_same_lines():
    """At 51.2 Hz, 10 cycles are exactly 4000 samples of 20,480 per second: numpy's FFT needs no interpolation."""
    random = np.random.default_rng(7)
    falling = random.normal(0, 1, (2, 800)) / np.arange(1, 801)  # with frequency, as the voltage of mains
    x = np.tile(np.fft.irfft(np.append(0, falling[0] + 1j * falling[1]), 4_000) * 4_000, 2)[:5_000]
    found = spectrum(x[None], 500.0, 4_000.0, 10)
    reference = np.fft.rfft(x[500:4_500]) / 4_000 * np.sqrt(2)
    # The first sample is half a cell after the begin of the interval.
    turn = np.exp(-1j * np.pi * np.arange(511) / 4_000)
    assert np.abs(found[0, 1:511] - (reference[:511] * turn)[1:]).max() < 1e-4 * np.abs(reference[1:]).max()


def subgroups_of_mhkit(x, rate, nominal):
    """Another program's subgroups up to order 50: amplitudes of the lines of 5 Hz of an FFT, three squares added.

    `harmonics` and `harmonic_subgroups` in mhkit/power/quality.py of MHKiT-Python (BSD-3-Clause), with numpy alone.
    """
    amplitude = np.abs(np.fft.fft(x))[: len(x) // 2] / len(x) * 2
    centre = np.arange(1, 51) * round(nominal / (rate / len(x)))
    return np.sqrt(amplitude[centre - 1] ** 2 + amplitude[centre] ** 2 + amplitude[centre + 1] ** 2)


@pytest.mark.parametrize(("nominal", "cycles"), [(50, 10), (60, 12)])
def test_subgroups_are_those_of_mhkit(nominal, cycles):
    rate, random = 20_000.0, np.random.default_rng(3)
    t = (np.arange(6_000) + 0.5) / rate
    x = U1 * np.sqrt(2) * np.cos(2 * np.pi * nominal * t)
    for f in (*(nominal * np.arange(2, 51)), 3 * nominal + 5, 7 * nominal - 5, 182.0):  # 182 Hz leaks
        x += random.uniform(0.1, 8) * np.cos(2 * np.pi * f * t + random.uniform(0, 6))
    found = spectrum(x[None], 1_000.0, 4_000.0, cycles)
    theirs = subgroups_of_mhkit(x[1_000:5_000], rate, nominal) / np.sqrt(2)  # of amplitudes
    assert np.abs(harmonic_subgroups(line_squares(found, cycles))[0] - theirs).max() < 1e-4 * U1


def test_thds_is_the_root_of_the_squares_over_the_first():
    subgroups = np.zeros((1, 50))
    subgroups[0, [0, 2, 4]] = 230.0, 6.9, 9.2
    assert thds(subgroups)[0] == pytest.approx(5.0)
    subgroups[0, 40:] = np.nan
    assert thds(subgroups)[0] == pytest.approx(5.0)
    assert np.isnan(thds(np.zeros((1, 50)))[0])


def test_harmonics_that_the_rate_does_not_tell_are_not_known():
    assert [known_orders(rate, 50.0) for rate in (2_000.0, 4_000.0, 20_000.0)] == [15, 31, 50]
