"""Flat tops in noise."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering.blurred import blurred_tops
from acqd.sources.recording.marks import marks_of
from tests.places import WAVEFORMS

RANDOM = np.random.default_rng(1)
ANGLE = 2 * np.pi * 50 * np.arange(800) / 20_000 + 0.7
WAVES = {
    "sine": np.cos(ANGLE),
    "third": np.cos(ANGLE) - 0.05 * np.cos(3 * ANGLE),
    "flat": np.cos(ANGLE) - 0.04 * np.cos(5 * ANGLE),  # as rectifiers leave the mains
    "dip": np.cos(ANGLE) - 0.1 * np.cos(3 * ANGLE),
}


@pytest.mark.parametrize("noise", [2e-4, 1e-3])
@pytest.mark.parametrize("name", WAVES)
def test_a_cut_wave_is_told_from_a_smooth_one(name, noise):
    wave = WAVES[name]
    hiss = noise * RANDOM.normal(size=len(wave))
    assert not blurred_tops(wave + hiss)
    assert blurred_tops(np.clip(wave, -0.8, 0.8) * 325 + 325 * hiss)
    assert blurred_tops(np.clip(wave, -2.0, 0.8) + hiss)  # one side


def rectifier(overlap: float) -> np.ndarray:
    """Line current of a six-pulse bridge with a large choke, whose commutation lasts `overlap` [rad]."""
    flank = np.clip((np.mod(ANGLE, np.pi) - np.pi / 6) / overlap, 0, 1)
    return np.sign(np.sin(ANGLE)) * (flank - np.clip((np.mod(ANGLE, np.pi) - 5 * np.pi / 6) / overlap, 0, 1))


LOADS = {
    "blocks": rectifier(0.05), "overlap": rectifier(0.15), "long overlap": rectifier(0.45),
    "half waves": np.maximum(np.cos(ANGLE), 0),
    "phase control": np.where(np.mod(ANGLE, np.pi) > 1.0, np.sin(ANGLE), 0), "direct": np.full(800, 5.0),
    "nothing": np.zeros(800), "inrush": np.cos(ANGLE) * np.exp(-np.arange(800) / 300) + 0.4,
}  # fmt: skip


@pytest.mark.parametrize("noise", [0.0, 2e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("name", LOADS)
def test_loads_are_not_cut(name, noise):
    assert not blurred_tops(LOADS[name] + noise * RANDOM.normal(size=800))
    assert not blurred_tops(np.rint(50 * LOADS[name] + noise * RANDOM.normal(size=800)))  # eight bits


def test_a_recording_is_flagged_where_it_is_cut():
    x = np.tile(WAVES["sine"], 10)
    x[2_400:4_800] *= 1.5
    x = np.clip(x, -1.2, 1.2) + 5e-4 * RANDOM.normal(size=len(x))
    assert marks_of(np.stack((x, x), axis=1), 20_000, 50.0) == ((2_400, 4_800, frozenset({"clipped"})),)


@pytest.mark.skipif(not WAVEFORMS.is_dir(), reason="../shared/data/waveforms is absent")
def test_no_real_recording_is_cut():
    for path in WAVEFORMS.glob("*/*.npz"):
        with np.load(path) as file:
            size = round(2 * float(file["fs"]) / float(file.get("f_nominal", 50.0)))
            for key in ("u_code", "i_code"):
                for row in np.atleast_2d(file[key]):
                    ats = range(0, len(row) - size, max(size, len(row) // 60))
                    assert not any(blurred_tops(row[at : at + size].astype(float)) for at in ats), (path, key)
