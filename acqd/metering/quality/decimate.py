"""Fewer samples of a fast stream: means of so many neighbours, and what that takes from each frequency.

Harmonics up to the 50th need no more than 800 samples per cycle. The mean of q samples has its zeros at multiples of
the new rate, exactly where frequencies fold to DC; what folds to the 50th harmonic is damped to a tenth or less. Its
droop in the band is known and divided out (`droop`).
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats

ENOUGH = 800
"""Samples per cycle."""


def factor_of(per_cycle: float) -> int:
    """How many samples of a stream with `per_cycle` samples per mains cycle become one."""
    return max(1, int(per_cycle / ENOUGH))


def decimated(x: Floats, factor: int) -> Floats:
    """Means of `factor` samples of `x` [channels, samples]; cell [k, k + 1) of the result is k * factor of `x`."""
    if factor == 1:
        return x
    whole = x.shape[1] // factor * factor
    return np.asarray(x[:, :whole].reshape(len(x), -1, factor).mean(axis=2))


def droop(cycles_per_sample: Floats, factor: int) -> Floats:
    """Amplitude left of frequencies [1/sample of the fast stream]: the Dirichlet kernel of `factor` samples."""
    if factor == 1:
        return np.ones_like(cycles_per_sample)
    angle = np.pi * np.maximum(cycles_per_sample, 1e-12)
    return np.asarray(np.sin(factor * angle) / (factor * np.sin(angle)))
