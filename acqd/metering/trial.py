"""Vectors of one trial frequency: what a stretch of voltage is projected on.

The voltage is modelled as DC + harmonics 1..H of the trial frequency f0, plus the derivative of the fundamental with
respect to frequency. Weighted least squares with the weight 4 s (1 - s) over the stretch, s = 0 .. 1: a phase jump near
an end of the stretch, which nothing can tell from noise, moves f by the square of its distance from the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from acqd.arrays import Floats

CYCLES = 7
"""One-cycle phasors per stretch, which show phase jumps."""
_HARMONICS = 25  # EN 50160 tabulates harmonics up to here


@dataclass(frozen=True, slots=True)
class Trial:
    """Vectors over `samples` samples."""

    projection: Floats
    """[4, samples]: voltage times this is Re c, -Im c, Re d, -Im d of fundamental and derivative."""
    turn: Floats
    """[2, samples]: cos and sin of the trial frequency."""
    edges: Floats
    """[2, CYCLES] begin and end of the one-cycle phasors [samples]; the last ends with the stretch."""

    phasors: Floats
    """[samples, 2, CYCLES]: voltage times this is the real part and the negative imaginary part of the phasors."""


@lru_cache(maxsize=128)  # 2.5 Hz of wander; 24 MB at 1200 samples
def make_trial(f: float, rate: float, samples: int, *, tapered: bool = True) -> Trial:
    """Vectors of the trial frequency `f` [Hz] for `samples` samples at `rate` [1/s], kept for all meters."""
    time = (np.arange(samples) - (samples - 1) / 2) / rate
    highest = min(_HARMONICS, int(0.48 * rate / f))
    fundamental = np.exp(2j * np.pi * f * time)[:, None]
    harmonics = np.multiply.accumulate(np.broadcast_to(fundamental, (samples, highest)), axis=1)
    cos, sin = harmonics.real, harmonics.imag
    span = time[-1]  # keeps the slope columns of the same size as the others
    slope = time[:, None] / span * np.column_stack((cos[:, 0], sin[:, 0]))
    basis = np.column_stack((cos[:, :1], sin[:, :1], slope, np.ones_like(time), cos[:, 1:], sin[:, 1:]))
    share = (np.arange(samples) + 0.5) / samples
    weighted = basis * (4 * share * (1 - share))[:, None] if tapered else basis
    # not with BLAS, whose threads take longer to begin than this takes
    normal = np.einsum("nj,nk->jk", basis, weighted)
    rows = weighted @ np.linalg.solve(normal, np.eye(basis.shape[1])[:, :4])
    rows[:, 2:] /= span
    turn = np.ascontiguousarray(np.stack((cos[:, 0], sin[:, 0])))
    end = np.linspace(rate / f, samples, CYCLES)
    edges = np.stack((end - rate / f, end))
    return Trial(np.ascontiguousarray(rows.T), turn, edges, _phasors(turn, edges))


def _phasors(turn: Floats, edges: Floats) -> Floats:
    begin, end = edges
    samples = np.arange(turn.shape[1])[:, None]
    inside = np.clip(end - samples, 0, 1) - np.clip(begin - samples, 0, 1)  # edges share a sample
    return np.asarray(turn.T[:, :, None] * inside[:, None, :])
