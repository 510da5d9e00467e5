"""Synthetic mains with a known truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

EN50160 = {
    2: 0.02, 3: 0.05, 4: 0.01, 5: 0.06, 6: 0.005, 7: 0.05, 8: 0.005, 9: 0.015, 10: 0.005, 11: 0.035, 13: 0.03,
    15: 0.005, 17: 0.02, 19: 0.015, 21: 0.005, 23: 0.015, 25: 0.015,
}  # fmt: skip
"""EN 50160 limits, all at once: worse than any mains."""


@dataclass
class Mains:
    """Synthetic mains as codes, with the exact answers."""

    codes: np.ndarray
    scale: tuple[float, ...]
    rate: float
    Vrms: float
    Irms: float
    P: float


def make_mains(
    f: float,
    *,
    seconds: float = 4.0,
    rate: float = 20_000.0,
    phases: int = 3,
    harmonics: dict[int, float] | None = None,
    noise: float = 0.0,
    dc: float = 0.0,
    volts: float = 230.0,
    amperes: float = 3.0,
    lag: float = 0.5,
    seed: int = 0,
) -> Mains:
    """u with `harmonics`, DC and noise (shares of the fundamental), i a lagging sine with some H3."""
    random = np.random.default_rng(seed)
    harmonics = harmonics or {}
    count = int(seconds * rate)
    t = np.arange(count) / rate
    scale = (737.2575 / 32768, 9.207527 / 32768)
    codes = np.empty((count, 2 * phases), dtype=np.int16)
    angles = {h: random.uniform(0, 2 * np.pi) for h in {*harmonics, 3}}
    for phase in range(phases):
        angle = 2 * np.pi * f * t - 2 * np.pi * phase / 3 + 0.3
        u = np.cos(angle) + dc
        for h, share in harmonics.items():
            u = u + share * np.cos(h * angle + angles[h])
        i = np.cos(angle - lag) + 0.1 * np.cos(3 * (angle - lag))
        u = u + noise * random.standard_normal(count)
        codes[:, 2 * phase] = np.rint(u * volts * np.sqrt(2) / scale[0])
        codes[:, 2 * phase + 1] = np.rint(i * amperes * np.sqrt(2) / scale[1])
    # cos carries volts^2 of mean square; DC of `dc` amplitudes carries (dc * sqrt 2 * volts)^2.
    square = 1 + sum(share**2 for share in harmonics.values()) + 2 * dc**2
    third = harmonics.get(3, 0.0) * 0.1 * np.cos(angles[3] + 3 * lag)
    power = volts * amperes * (np.cos(lag) + third)
    return Mains(codes, scale * phases, rate, volts * np.sqrt(square), amperes * np.sqrt(1.01), float(power))
