"""Loads that are on or off: [T] 0 or 1."""

from __future__ import annotations

import numpy as np

from tools.studies.foreign.generator.arm import Floats


def bursts(t: Floats, random: np.random.Generator, on_s: tuple[float, float], off_s: tuple[float, float]) -> Floats:
    """Irregular: dwell times drawn from two ranges."""
    pairs = int(t[-1] / (on_s[0] + off_s[0])) + 2
    dwell = np.stack([random.uniform(*off_s, pairs), random.uniform(*on_s, pairs)], axis=1).ravel()
    return np.asarray(np.searchsorted(np.cumsum(dwell), t, side="right") % 2, dtype=np.float64)


def rhythm(t: Floats, random: np.random.Generator, period_s: float, duty: float) -> Floats:
    """A thermostat: dwell times scatter by 3 %."""
    pairs = int(t[-1] / period_s * 1.2) + 3
    dwell = np.tile([period_s * (1 - duty), period_s * duty], pairs) * random.normal(1, 0.03, 2 * pairs)
    start = random.uniform(0, period_s)
    return np.asarray(np.searchsorted(np.cumsum(dwell), t + start, side="right") % 2, dtype=np.float64)
