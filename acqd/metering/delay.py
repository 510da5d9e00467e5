"""Delay of a sampled signal by a fraction of a sample: Lagrange interpolation over eight samples.

At 20 kHz and a delay of half a sample, a 50 Hz sine keeps its phase within 1e-12 rad and a 2.5 kHz sine its amplitude
within 0.5 %.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats

POINTS = 8
"""Samples that an interpolation reads."""


def delayed(x: Floats, samples: float, begin: int, end: int) -> Floats:
    """x(n - samples) for n = begin .. end - 1; positions must lie inside `x` [samples]."""
    whole = int(np.floor(samples))
    if whole == samples:
        return x[begin - whole : end - whole]
    share = 1.0 - (samples - whole)  # between sample n - whole - 1 and the next
    padded = _padded(x)
    first = begin - whole - 1 - (POINTS // 2 - 1) + POINTS
    result = np.zeros(end - begin)
    for k, weight in enumerate(weights(share)):
        result += weight * padded[first + k : first + k + end - begin]
    return result


def weights(share: float) -> list[float]:
    """Lagrange weights of samples -3 .. 4 at position `share` between samples 0 and 1."""
    nodes = np.arange(POINTS) - (POINTS // 2 - 1)
    return [float(np.prod([(share - m) / (n - m) for m in nodes if m != n])) for n in nodes]


def _padded(x: Floats) -> Floats:
    """`x` continued at both ends by odd reflection, so that the stencil fits everywhere."""
    if len(x) <= POINTS:
        return np.pad(x, POINTS, mode="edge")
    before, after = 2 * x[0] - x[POINTS:0:-1], 2 * x[-1] - x[-2 : -2 - POINTS : -1]
    return np.concatenate((before, x, after))
