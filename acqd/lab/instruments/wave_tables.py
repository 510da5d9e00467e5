"""One mains cycle of voltage and current as tables, and interpolation to the sample rate of the EL3783."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.motion.controller import RATE
from acqd.sources import el3783

PER_MS = round(el3783.RATE / RATE)
"""Samples per value of the plant."""
_SIZE = 8192
_ANGLE = 2 * np.pi * np.arange(_SIZE) / _SIZE
_CREST, _HALF_WIDTH = np.radians(84), np.radians(38)  # of a rectifier's pulses: just before the crest of the voltage


def voltage_table(harmonics: Mapping[int, float], random: np.random.Generator) -> Floats:
    """Voltage per Vrms over one cycle, with harmonics (order -> share) of random phase."""
    u = _with_harmonics(harmonics, random)
    return _closed(u / np.sqrt(np.mean(u**2)))


def pfc_current_table(harmonics: Mapping[int, float], random: np.random.Generator, voltage: Floats) -> Floats:
    """Current of a power-factor-corrected input, scaled so that its mean product with `voltage` is 1."""
    return _per_watt(_with_harmonics(harmonics, random), voltage)


def rectifier_current_table(voltage: Floats) -> Floats:
    """Current pulses of a rectifier with smoothing capacitor, scaled like `pfc_current_table`."""
    away = (_ANGLE - _CREST + np.pi / 2) % np.pi - np.pi / 2
    pulse = np.where(np.abs(away) < _HALF_WIDTH, np.cos(away / _HALF_WIDTH * np.pi / 2), 0.0)
    return _per_watt(pulse * np.sign(np.sin(_ANGLE)), voltage)


def _with_harmonics(harmonics: Mapping[int, float], random: np.random.Generator) -> Floats:
    wave = np.sin(_ANGLE)
    for order, share in sorted(harmonics.items()):
        wave += share * np.sin(order * _ANGLE + random.uniform(0, 2 * np.pi))
    return wave


def _per_watt(current: Floats, voltage: Floats) -> Floats:
    return _closed(current / np.mean(voltage[:-1] * current))


def _closed(table: Floats) -> Floats:
    """The table with its first value repeated at the end, for interpolation."""
    return np.concatenate([table, table[:1]])


COSINE = _closed(np.cos(_ANGLE))
"""Leads a sine by a quarter of a cycle: the current of a capacitor."""


def lookup(table: Floats, cycles: Floats) -> Floats:
    """Values of a one-cycle `table` at `cycles`, linearly interpolated."""
    position = cycles * _SIZE
    before: NDArray[np.int64] = position.astype(np.int64)
    share = position - before
    before &= _SIZE - 1
    low = table[before]
    return np.asarray(low + share * (table[before + 1] - low))


def resample(grid: Floats) -> Floats:
    """Values [T] 1 ms apart, linearly interpolated to [(T - 1) * PER_MS] values 50 us apart."""
    share = np.arange(PER_MS) / PER_MS
    return np.asarray((grid[:-1, None] + np.diff(grid)[:, None] * share).ravel())
