"""Vectors of one trial frequency: what a stretch of voltage is projected on.

The voltage is modelled as DC + harmonics 1..H of the trial frequency f0, plus the derivative of the fundamental with
respect to frequency. It is fitted twice by weighted least squares: over the two cycles that the other quantities of
the window are from, and over the whole stretch. The weight of the first is 4 s (1 - s), s = 0 .. 1 over the cycles: a
phase jump near an end, which nothing can tell from noise, moves f by the square of its distance from the end. That of
the second is the root of it: f is steady where it counts, and has less noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from acqd.arrays import Floats
from acqd.metering.walk import mean_weights

CYCLES = 7
"""One-cycle phasors per stretch, which show phase jumps."""
FITTED_CYCLES = 2
"""Mains cycles of the first fit: those of the other quantities."""
_HARMONICS = 25  # EN 50160 tabulates harmonics up to here


@dataclass(frozen=True, slots=True)
class Trial:
    """Vectors over `samples` samples."""

    projection: Floats
    """[6, samples]: voltage times this is Re c, -Im c of the fundamental and Re d, -Im d of its derivative over two
    cycles, and Re d, -Im d over the stretch."""
    turn: Floats
    """[2, samples]: cos and sin of the trial frequency."""
    edges: Floats
    """[2, CYCLES] begin and end of the one-cycle phasors [samples]; the last ends with the stretch."""

    mean: Floats
    """[CYCLES]: phases of the one-cycle phasors [rad] times this are Hz of the mean f over the two cycles above the
    trial, whatever f does within them (`walk`)."""
    phasors: Floats
    """[samples, 2, CYCLES]: voltage times this is the real part and the negative imaginary part of the phasors."""


@lru_cache(maxsize=128)  # 2.5 Hz of wander; 30 MB at 1200 samples
def make_trial(f: float, rate: float, samples: int, window: int) -> Trial:
    """Vectors of the trial frequency `f` [Hz] for `samples` samples at `rate` [1/s], kept for all meters.

    The window is the last `window` samples; its two cycles lie as `interval_of` says.
    """
    start, stop = interval_of(f, rate, samples, window)
    time = (np.arange(samples) + 0.5 - (start + stop) / 2) / rate  # from the middle of the cycles
    highest = min(_HARMONICS, int(0.48 * rate / f))
    fundamental = np.exp(2j * np.pi * f * time)[:, None]
    harmonics = np.multiply.accumulate(np.broadcast_to(fundamental, (samples, highest)), axis=1)
    cos, sin = harmonics.real, harmonics.imag
    span = samples / rate / 2  # keeps the slope columns of the same size as the others
    slope = time[:, None] / span * np.column_stack((cos[:, 0], sin[:, 0]))
    basis = np.column_stack((cos[:, :1], sin[:, :1], slope, np.ones_like(time), cos[:, 1:], sin[:, 1:]))
    cycles = _least_squares(basis, _hump(samples, start, stop))
    stretch = _least_squares(basis, np.sqrt(_hump(samples, 0.0, float(samples))))
    rows = np.column_stack((cycles, stretch[:, 2:]))
    rows[:, 2:] /= span
    turn = np.ascontiguousarray(np.stack((cos[:, 0], sin[:, 0])))
    end = np.linspace(rate / f, samples, CYCLES)
    edges = np.stack((end - rate / f, end))
    mean = mean_weights(edges, start, stop, rate)
    return Trial(np.ascontiguousarray(rows.T), turn, edges, mean, _phasors(turn, edges))


def interval_of(f: float, rate: float, samples: int, window: int) -> tuple[float, float]:
    """Begin and end of the two cycles in a stretch of `samples` whose last `window` samples are the window.

    In the middle of the window where they fit, else they end with it; no more than the stretch.
    """
    length = FITTED_CYCLES * rate / f
    stop = samples - (window - length) / 2 if window >= length else float(samples)
    return max(stop - length, 0.0), stop


def _hump(samples: int, start: float, stop: float) -> Floats:
    """4 s (1 - s) over start .. stop, 0 elsewhere."""
    share = np.clip((np.arange(samples) + 0.5 - start) / (stop - start), 0.0, 1.0)
    return np.asarray(4 * share * (1 - share))


def _least_squares(basis: Floats, weight: Floats) -> Floats:
    """[samples, 4]: a signal times this is the first four coefficients of its fit by the columns of `basis`."""
    weighted = basis * weight[:, None]
    # not with BLAS, whose threads take longer to begin than this takes
    normal = np.einsum("nj,nk->jk", basis, weighted)
    return np.asarray(weighted @ np.linalg.solve(normal, np.eye(basis.shape[1])[:, :4]))


def _phasors(turn: Floats, edges: Floats) -> Floats:
    begin, end = edges
    samples = np.arange(turn.shape[1])[:, None]
    inside = np.clip(end - samples, 0, 1) - np.clip(begin - samples, 0, 1)  # edges share a sample
    return np.asarray(turn.T[:, :, None] * inside[:, None, :])
