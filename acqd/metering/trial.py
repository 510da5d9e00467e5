"""Vectors of one trial frequency: what a stretch of voltage is projected on.

The voltage is modelled as DC + harmonics 1..H of the trial frequency f0, plus the derivative of the fundamental with
respect to frequency. It is fitted twice by weighted least squares: over the two cycles that the other quantities of
the window are from, and over the whole stretch. The weight of the first is 4 s (1 - s), s = 0 .. 1 over the cycles: a
phase jump near an end, which nothing can tell from noise, moves f by the square of its distance from the end. That of
the second is the root of it: f is steady where it counts, and has less noise.

A step of f shortly before the end of the cycles moves their mean f, and the fit hardly: its weight is small there. The
phase has a kink then, which a third fit looks for: over the last three cycles, evenly weighted, with a phase that is a
parabola (a level, f, a ramp of f) and a straight line that leaves it `LATE` before the end (a matched filter for
that line in white noise, by the Frisch-Waugh-Lovell theorem).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from acqd.arrays import Floats

CYCLES = 7
"""One-cycle phasors per stretch, which show phase jumps."""
FITTED_CYCLES = 2
"""Mains cycles of the first fit: those of the other quantities."""
LATE = 0.008
"""s before the end of the two cycles, from where on the phase may leave its parabola."""
_KINK_CYCLES = 3
_HARMONICS = 25  # EN 50160 tabulates harmonics up to here


@dataclass(frozen=True, slots=True)
class Trial:
    """Vectors over `samples` samples."""

    projection: Floats
    """[8, samples]: voltage times this is Re c, -Im c of the fundamental and Re d, -Im d of its derivative over two
    cycles, Re d, -Im d over the stretch, and Re k, -Im k: Im(k / c) is what the kink moves the mean f by [Hz]."""
    first: int
    """Sample of the stretch with which the two cycles begin: before, c and d have no weight."""
    turn: Floats
    """[2, samples]: cos and sin of the trial frequency."""
    edges: Floats
    """[2, CYCLES] begin and end of the one-cycle phasors [samples]; the last ends with the stretch."""

    phasors: Floats
    """[samples, 2, CYCLES]: voltage times this is the real part and the negative imaginary part of the phasors."""


@lru_cache(maxsize=128)  # 2.5 Hz of wander; 30 MB at 1200 samples
def make_trial(f: float, rate: float, samples: int, window: int) -> Trial:
    """Vectors of the trial frequency `f` [Hz] for `samples` samples at `rate` [1/s], kept for all meters.

    The window is the last `window` samples; its two cycles lie as `interval_of` says.
    """
    start, stop = interval_of(f, rate, samples, window)
    time: Floats = np.asarray((np.arange(samples) + 0.5 - (start + stop) / 2) / rate)  # from the middle of the cycles
    highest = min(_HARMONICS, int(0.48 * rate / f))
    fundamental = np.exp(2j * np.pi * f * time)[:, None]
    harmonics = np.multiply.accumulate(np.broadcast_to(fundamental, (samples, highest)), axis=1)
    cos, sin = harmonics.real, harmonics.imag
    span = samples / rate / 2  # keeps the slope columns of the same size as the others
    slope = time[:, None] / span * np.column_stack((cos[:, 0], sin[:, 0]))
    basis = np.column_stack((cos[:, :1], sin[:, :1], slope, np.ones_like(time), cos[:, 1:], sin[:, 1:]))
    cycles = _least_squares(basis, _hump(samples, start, stop))
    stretch = _least_squares(basis, np.sqrt(_hump(samples, 0.0, float(samples))))
    kink = _kink(basis, time, span, (start, stop), rate / f)
    rows = np.column_stack((cycles[:, :2], cycles[:, 2:] / span, stretch[:, 2:] / span, kink))
    turn = np.ascontiguousarray(np.stack((cos[:, 0], sin[:, 0])))
    end = np.linspace(rate / f, samples, CYCLES)
    edges = np.stack((end - rate / f, end))
    return Trial(np.ascontiguousarray(rows.T), math.floor(start), turn, edges, _phasors(turn, edges))


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


def _kink(basis: Floats, time: Floats, span: float, bounds: tuple[float, float], period: float) -> Floats:
    """[samples, 2] for Re k, -Im k; zeros where there are too few samples for so many columns."""
    start, stop = bounds
    first = max(math.ceil(len(time) - _KINK_CYCLES * period), 0)
    line = np.maximum(time - (time[0] + (stop - 0.5) * (time[1] - time[0]) - LATE), 0.0)[:, None] * basis[:, :2]
    columns = np.column_stack((line, basis, (time[:, None] / span) ** 2 * basis[:, :2]))[first:]
    result = np.zeros((len(time), 2))
    if len(columns) >= 2 * columns.shape[1]:
        fitted = _least_squares(columns, np.ones(len(columns)))[:, :2]
        # rad/s of the line -> Hz of the mean over the cycles, of which it covers LATE
        result[first:] = fitted * LATE / ((stop - start) * (time[1] - time[0])) / (2 * np.pi)
    return result


def _phasors(turn: Floats, edges: Floats) -> Floats:
    begin, end = edges
    samples = np.arange(turn.shape[1])[:, None]
    inside = np.clip(end - samples, 0, 1) - np.clip(begin - samples, 0, 1)  # edges share a sample
    return np.asarray(turn.T[:, :, None] * inside[:, None, :])
