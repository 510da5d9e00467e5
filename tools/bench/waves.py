"""Synthetic mains with exactly known quantities, and the folder of the recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.metering import StreamFormat
from acqd.metering.block import Codes

RATE = 20_000.0
SCALE = (737.2575 / 32768, 9.207527 / 32768)
EN50160 = {2: 0.02, 3: 0.05, 4: 0.01, 5: 0.06, 7: 0.05, 9: 0.015, 11: 0.035, 13: 0.03, 17: 0.02, 19: 0.015, 23: 0.015}
RECORDINGS = Path(__file__).parents[2].parent / "shared" / "data" / "waveforms"


@dataclass(frozen=True, slots=True)
class Wave:
    """Codes, and the quantities that a perfect meter would give: V, W, VA, Hz, var."""

    codes: Codes
    form: StreamFormat
    Vrms: float
    P: float
    S: float
    f: float
    Q1: float


def hard_mains(f: float, phases: int, seconds: float, seed: int = 0, *, noise: float = 0.001, dc: float = 0.01) -> Wave:
    """EN 50160 harmonics at their limits, noise, DC, 16-bit codes; the current is a lagging sine."""
    random = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    codes = np.empty((len(t), 2 * phases), dtype=np.int16)
    volts, amperes, lag = 230.0, 3.0, 0.5
    angles = {h: random.uniform(0, 2 * np.pi) for h in EN50160}
    for phase in range(phases):
        angle = 2 * np.pi * f * t - 2 * np.pi * phase / 3 + random.uniform(0, 2 * np.pi) * (phase == 0)
        u = np.cos(angle) + dc + noise / np.sqrt(2) * random.standard_normal(len(t))
        for h, share in EN50160.items():
            u += share * np.cos(h * angle + angles[h])
        i = np.cos(angle - lag) + noise / np.sqrt(2) * random.standard_normal(len(t))
        codes[:, 2 * phase] = np.rint(u * volts * np.sqrt(2) / SCALE[0])
        codes[:, 2 * phase + 1] = np.rint(i * amperes * np.sqrt(2) / SCALE[1])
    rms = volts * float(np.sqrt(1 + sum(a * a for a in EN50160.values()) + 2 * dc**2 + noise**2))
    form = StreamFormat(RATE, SCALE * phases)
    P, Q1 = volts * amperes * float(np.cos(lag)), volts * amperes * float(np.sin(lag))
    return Wave(codes, form, rms, P, rms * amperes, f, Q1)
