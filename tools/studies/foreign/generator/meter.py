"""The meter: windows of 40 ms, white and coloured noise, drift of the zero, and its mains voltage."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from tools.studies.foreign.generator.arm import Floats
from tools.studies.foreign.generator.motion import STEP_S

WINDOW_ROWS = 8
"""Rows of the simulation in a window."""
WINDOW_S = WINDOW_ROWS * STEP_S
_WHITE_W = 0.25
_COLOURED = ((0.25, 0.4), (0.4, 300.0))
"""Deviation in W and correlation time in s of each coloured part."""


def windows(values: Floats) -> Floats:
    """[T // WINDOW_ROWS] means over windows."""
    whole = len(values) // WINDOW_ROWS * WINDOW_ROWS
    return np.asarray(values[:whole].reshape(-1, WINDOW_ROWS).mean(axis=1))


def noise(count: int, random: np.random.Generator) -> Floats:
    """[count] W of noise, one value a window."""
    total = random.normal(0, _WHITE_W, count)
    for deviation, time_s in _COLOURED:
        total += walk(count, deviation, time_s, WINDOW_S, random)
    return np.asarray(total)


def walk(count: int, deviation: float, time_s: float, step_s: float, random: np.random.Generator) -> Floats:
    """[count] values of an Ornstein-Uhlenbeck process in its stationary state."""
    keep = float(np.exp(-step_s / time_s))
    kicks = random.normal(0, deviation * np.sqrt(1 - keep**2), count)
    values, _ = lfilter([1.0], [1.0, -keep], kicks, zi=[keep * random.normal(0, deviation)])
    return np.asarray(values)


def voltage(t: Floats, random: np.random.Generator) -> Floats:
    """[T] V of the mains: slow wander, and steps when neighbours switch."""
    seconds = np.arange(int(t[-1]) + 2)
    slow = walk(len(seconds), 3.0, 300.0, 1.0, random)
    toggles = np.cumsum(random.random(len(seconds)) < 1 / 120) % 2
    return np.asarray(np.interp(t, seconds, 231.0 + slow - 4.0 * toggles))
