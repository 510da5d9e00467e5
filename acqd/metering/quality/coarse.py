"""f to about half a hertz, from nothing: the strongest line of a tapered spectrum."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats

_GRID = 0.5  # Hz


def mains_range(f_nominal: float) -> tuple[float, float]:
    """Frequencies measured [Hz]: IEC 61000-4-30, section 5.1.2, 42.5 .. 57.5 at 50 Hz and 51 .. 69 at 60 Hz."""
    system = nominal_system(f_nominal)
    return 0.85 * system, 1.15 * system


def nominal_system(f_nominal: float) -> float:
    """50 or 60 Hz."""
    return 60.0 if f_nominal > 55 else 50.0


def coarse_f(u: Floats, rate: float, f_nominal: float) -> float:
    """f [Hz] of `u` [phases, samples], about ten cycles long."""
    low, high = mains_range(f_nominal)
    grid = np.arange(low - 1, high + 1 + _GRID, _GRID)
    time = np.arange(u.shape[1]) / rate
    ac = (u - u.mean(axis=1, keepdims=True)) * np.hanning(u.shape[1])
    # not with BLAS, whose threads take longer to begin than this takes
    power = (np.abs(np.einsum("pn,nf->pf", ac, np.exp(-2j * np.pi * np.outer(time, grid)))) ** 2).sum(axis=0)
    return float(grid[np.argmax(power)])
