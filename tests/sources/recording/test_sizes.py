"""Hints where the size of a voltage or current contradicts its role or its scale."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.sources import load_waveform
from acqd.sources.recording.sizes import hints
from tests.places import WAVEFORMS

NAMES = ["UA", "IA", "UB", "IB", "UC", "IC"]


def samples(volts: float, amperes: float = 5.0, zero: float = 0.0, third: float = 0.0, lag: float = 0.5) -> np.ndarray:
    angle = 2 * np.pi * 50 * np.arange(2_000)[:, None] / 5_000 - 2 * np.pi * np.arange(3) / 3
    wave = np.empty((2_000, 6))
    wave[:, 0::2] = np.sqrt(2) * volts * (np.cos(angle) + third * np.cos(3 * angle)) + zero
    wave[:, 1::2] = np.sqrt(2) * amperes * np.cos(angle - lag)
    return wave


def said(values: np.ndarray, roles_by_name: bool = True) -> str:
    return " ".join(hints(list(enumerate(NAMES)), values, np.ones(6), (5_000.0, 50.0), roles_by_name))


@pytest.mark.parametrize("volts", [100.0, 115.0, 120.0, 200.0, 208.0, 220.0, 230.0, 240.0, 253.0, 380.0, 398.0, 415.0, 480.0, 690.0, 3_300.0, 11_000.0, 109_600.0, 380e3])  # fmt: skip  # noqa: E501
def test_phases_with_the_size_of_voltages_between_lines_are_asked_about(volts):
    assert "UA, UB, UC have" in said(samples(volts))
    assert "--map u1=0,i1=1,u2=2,i2=3,u3=4,i3=5 to neutral, --map u12=0,u23=2,u31=4,i1=1" in said(samples(volts))
    assert not said(samples(volts), roles_by_name=False)  # the user has said what they are
    assert not said(samples(volts, zero=0.1 * volts))  # voltages between lines close a loop
    assert not said(samples(volts, third=0.004))  # also at three times the frequency


@pytest.mark.parametrize("volts", [277.0, 347.0, 6_351.0, 11_547.0, 63_508.0, 230.9e3])
def test_voltages_to_neutral_are_not(volts):
    assert not said(samples(volts))


@pytest.mark.parametrize("volts", [57.7, 63.5, 66.4])
def test_voltages_behind_transformers_without_a_ratio_are_asked_about(volts):
    assert "these values secondary, without a ratio (--u-scale, --i-scale)?" in said(
        samples(volts), roles_by_name=False
    )


@pytest.mark.parametrize(
    "names", ["V1N V2N V3N", "Van Vbn Vcn", "U_RN U_SN U_TN", "UL1-N UL2-N UL3-N", "uL1E uL2E uL3E"]
)
def test_names_that_say_to_neutral_are_believed(names):
    channels = [(k, names.split()[k // 2] if k % 2 == 0 else f"I{k // 2}") for k in range(6)]
    assert not hints(channels, samples(230.0), np.ones(6), (5_000.0, 50.0), True)
    bare = [(k, name[:-1]) for k, name in channels]
    assert hints(bare, samples(230.0), np.ones(6), (5_000.0, 50.0), True)


def test_the_question_shows_what_the_angles_make_of_either_answer():
    assert "to neutral 3028 W with I 29 degrees behind U, between lines 1991 W with I 1 degrees before" in said(
        samples(230.0)
    )
    assert "the angles speak for neutral" in said(samples(230.0, lag=-0.2))  # between lines it would lead by 41 degrees
    assert "the angles speak for lines" in said(samples(230.0, lag=1.7))  # to neutral it would feed back
    assert "no load shows which" in said(samples(230.0, amperes=1e-5) * [1, 0, 1, 0, 1, 0])


def test_channels_without_a_value_or_beyond_every_network_are_asked_about():
    values = samples(277.0)
    values[:, 2] *= 1e-30
    values[:, 5] = 0.0
    assert "UB: never above 3.92e-28 V" in said(values) and "IC: never above 0 A" in said(values)
    assert "more than any network has" in said(samples(63.5e6)) and "UA, UB, UC: 6.35e+07 V" in said(samples(63.5e6))
    assert "IA, IB, IC: 1e+06 A" in said(samples(277.0, 1e6))


@pytest.mark.skipif(not WAVEFORMS.is_dir(), reason="../shared/data/waveforms is absent")
def test_real_recordings_raise_no_question():
    for path in sorted(WAVEFORMS.glob("*/replay_20k_el3783.npz")):
        assert not load_waveform(path).notes, path


def test_a_single_phase_behind_a_voltage_transformer_is_asked_about():
    t = np.arange(2_000) / 10_000
    codes = np.rint(np.stack((577 * 2**0.5 * np.cos(314.16 * t), 500 * np.cos(314.16 * t)), 1)).astype(np.int16)
    asked = hints([(0, "VA"), (1, "IA")], codes, np.array([0.1, 0.01]), (10_000.0, 50.0), True)
    assert len(asked) == 1 and "as behind voltage transformers" in asked[0]


def test_a_direct_voltage_of_60_v_is_not_asked_about():
    codes = np.full((2_000, 2), (600, 200), dtype=np.int16)
    assert not hints([(0, "u1"), (1, "i1")], codes, np.array([0.1, 0.01]), (10_000.0, 50.0), True)
