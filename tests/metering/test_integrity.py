"""Clipped, rolled-over and shifted samples; no alarm on loads and recordings."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering.integrity import clipped, flags_of
from acqd.metering.look import Looker, look_at, look_by_numpy
from acqd.sources import load_waveform
from tests.mains import EN50160, make_mains
from tests.metering.transformers import secondary

T = np.arange(800) / 20_000
A = 2 * np.pi * 50 * T + 0.7
SINE = np.cos(A)
CYCLE = 400


def flags(u, i=None):
    return flags_of(np.column_stack([u, SINE if i is None else i]).astype(float), CYCLE)


@pytest.mark.parametrize("quantum", [0.0, 1 / 32768, 1 / 500])
@pytest.mark.parametrize("limit", [0.6, 0.9, 0.97])
def test_flat_tops_are_clipped_whatever_the_numbers_are(quantum, limit):
    x = np.clip(SINE, -limit, limit)
    x = np.rint(x / quantum) * quantum if quantum else x
    assert "clipped" in flags(x * 325) and "clipped" in flags(SINE, x * 7)
    assert "clipped" in flags(np.clip(SINE, -2, limit) * 325)  # one side


def test_a_wrap_is_a_roll_over_in_codes_and_in_volts():
    codes = np.rint(SINE * 40_000).astype(np.int64).astype(np.int16)  # wraps modulo 2^16
    assert flags(codes.astype(float)) == {"rollover"}
    assert flags(codes * 0.0225) == {"rollover"}


def test_a_wrap_just_beyond_the_range_is_a_roll_over_at_high_rates():
    cycle = 1024
    angle = 2 * np.pi * np.arange(2 * cycle) / cycle + 0.7
    codes = np.rint(np.cos(angle) * 36_000).astype(np.int64).astype(np.int16).astype(float)
    assert flags_of(np.column_stack([codes, np.cos(angle)]), cycle) == {"rollover"}


def test_a_mean_of_a_voltage_is_an_offset_and_of_a_current_a_load():
    assert "offset" in flags(SINE * 230 + 737)  # offset-binary codes
    assert flags(SINE * 325 + 3.0) == frozenset()  # 1 % is a converter's
    assert flags(SINE, SINE + 2) == frozenset()


T5 = np.arange(1_000) / 5_000  # ten cycles: the core settles
WAVE = np.cos(2 * np.pi * 50 * T5 + 0.3)
PRIMARIES = {"mean": WAVE + 0.2, "small mean": WAVE + 0.05, "half waves beside": WAVE + 0.6 * np.maximum(WAVE, 0),
             "inrush": WAVE - np.exp(-T5 / 0.1)}  # fmt: skip


@pytest.mark.parametrize("primary", PRIMARIES)
def test_a_saturated_transformer_is_named(primary):
    x = secondary(PRIMARIES[primary], 5_000, 0.6)
    at = slice(300, 500) if primary == "inrush" else slice(800, 1_000)  # a mean that decays settles first
    noise = 0.003 * np.random.default_rng(0).standard_normal(200)
    assert flags_of(np.column_stack([WAVE[at], x[at] + noise]), 100) == {"saturated"}
    linear = secondary(PRIMARIES[primary] - PRIMARIES[primary].mean(), 5_000, 20.0)
    assert flags_of(np.column_stack([WAVE[at], linear[at] + noise]), 100) == frozenset()


@pytest.mark.parametrize("at", [110, 230, 330, 510])
def test_a_load_that_is_switched_off_within_a_half_wave_is_no_saturated_transformer(at):
    assert flags(SINE, np.where(np.arange(800) < at, np.cos(A - 0.8), 0.0)) == frozenset()


LOADS = {
    "phase-fired": SINE * (np.mod(A, np.pi) > 1.2), "half-wave": np.maximum(SINE, 0), "direct": np.full(800, 4.2),
    "rectifier": np.where(np.abs(SINE) > 0.85, np.sign(SINE) * (np.abs(SINE) - 0.85), 0.0),
    "six pulses": np.where(np.abs(np.sin(A)) > 0.5, np.sign(np.sin(A)), 0.0), "off": np.zeros(800),
    "half-wave, fired": np.maximum(SINE, 0) * (np.mod(A + np.pi / 2, np.pi) > 0.6),
    "half-wave, cut": np.maximum(SINE, 0) * (np.mod(A + np.pi / 2, np.pi) < 2.0),
    "halves, fired unequally": SINE * (np.mod(A + np.pi / 2, np.pi) > np.where(SINE > 0, 1.2, 0.4)),
    "blocks": np.where(np.sin(A) > 0.5, 1.0, np.where(np.sin(A - 0.6) < -0.5, -1.0, 0.0)),
    "cut off": SINE * (np.mod(A + np.pi / 2, np.pi) < 2.0),
    "smoothed": 0.2 * np.sin(A) + 3.0, "small": np.rint(SINE * 6), "tiny": np.rint(SINE * 2), "one": np.rint(SINE * 0.6),  # noqa: E501
}  # fmt: skip


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_loads_raise_no_alarm(load, noise):
    x = LOADS[load] + noise * np.random.default_rng(0).standard_normal(800)
    assert flags(SINE * 325, x) == frozenset()
    assert flags(SINE * 325, np.rint(x * 1000)) == frozenset()
    assert flags(SINE * 325, x - x.mean()) == frozenset()  # behind a transformer that does not saturate


def test_distorted_mains_raise_no_alarm():
    for seed in range(5):
        codes = make_mains(50.1, seconds=1.0, harmonics=EN50160, noise=0.001, seed=seed).codes.astype(float)
        assert not any(flags_of(codes[k : k + 800], 400) for k in range(0, len(codes) - 800, 800))


def test_no_recording_raises_an_alarm(waveforms):
    for path in waveforms.glob("*/*.npz"):
        waveform = load_waveform(path)
        codes = waveform.codes.astype(float)
        size = round(2 * waveform.form.rate / waveform.form.f_nominal)
        for k in range(0, len(codes) - size, size):
            assert not flags_of(codes[k : k + size], size // 2), (path, k)


def test_rounded_tops_of_small_waves_are_not_clipped():
    """Four equal codes at the top of a sine with noise come by chance, once in some thousand looks."""
    random = np.random.default_rng(1)
    for _ in range(6_000):
        wave = random.uniform(1_000, 8_000) * np.cos(A + random.uniform(0, 6.28)) + random.normal(0, 0.4, len(A))
        assert not clipped(np.rint(wave), CYCLE)


@pytest.mark.parametrize("kind", [np.int16, np.int32])
def test_a_look_in_c_is_one_with_numpy(kind):
    random = np.random.default_rng(8)
    for samples, channels, cycle in ((800, 6, 400), (801, 2, 400), (37, 4, 50), (1, 6, 1)):
        codes = random.integers(-9, 9, (samples, channels)).astype(kind)
        assert look_at(codes, cycle) == look_by_numpy(codes, cycle)


def test_a_looker_reads_other_channels_than_its_own_without_c():
    codes = np.arange(40, dtype=np.int16).reshape(20, 2)
    assert Looker(6, 10).at(codes) == look_by_numpy(codes, 10)
