"""Voltages of no mains: a wrong rate, or direct ones."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering import StreamFormat
from acqd.sources.recording.alternating import remarks

RATE = 4_000.0
T = np.arange(4_000) / RATE
NOISE = np.random.default_rng(1).normal(0, 1, len(T))
FORM = StreamFormat(RATE, (1.0, 1.0), bits=64)


def said(u, form=FORM):
    return " ".join(remarks(np.stack((u, NOISE), axis=1), form))


@pytest.mark.parametrize(("f", "named"), [(25, "25 Hz"), (100, "100 Hz"), (37.5, "Hz, expected 15 to 17.5")])
def test_another_frequency_asks_about_the_rate(f, named):
    text = said(230 * np.sqrt(2) * np.cos(2 * np.pi * f * T))
    assert named in text and "--rate" in text


def test_a_direct_voltage_is_said():
    assert "is direct" in said(325 + NOISE)


@pytest.mark.parametrize(
    "u",
    [
        *(325 * np.cos(2 * np.pi * f * T) for f in (16.7, 44, 50, 60, 66, 400)),
        8 * np.cos(2 * np.pi * 150 * T), NOISE, 100 * NOISE, 0 * T,
        sum(100 * np.cos(2 * np.pi * f * T) for f in (25, 90, 150, 210)),
    ],
)  # fmt: skip
def test_mains_hum_noise_and_many_lines_ask_nothing(u):
    assert not said(u)


def test_a_short_recording_asks_nothing():
    assert not remarks(np.stack((325 * np.cos(2 * np.pi * 25 * T), NOISE), axis=1)[:1500], FORM)
