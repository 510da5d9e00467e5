"""Vectors of one trial frequency: what a stretch of voltage is projected on.

The voltage is modelled as DC + harmonics 1..H of the trial frequency f0, plus what f may do. It is fitted three times.

The first fit is over the two cycles that the other quantities of the window are from, with the derivative of the
fundamental with respect to frequency. Its weight is 4 s (1 - s), s = 0 .. 1 over the cycles: a phase jump near an end,
which nothing can tell from noise, moves f by the square of its distance from the end.

The two others are over the whole stretch, and their f is the mean over the two cycles: what the phase turns by between
the ends of these, as Wiener's smoother has it (N. Wiener, Extrapolation, Interpolation, and Smoothing of Stationary
Time Series, 1949; as generalised ridge regression) for an f that does a random walk beside white noise. A slow walk has
little noise and follows a change of f late; a fast one has more, and follows a step within the two cycles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from acqd.arrays import Floats

CYCLES = 7
"""One-cycle phasors per stretch, which show phase jumps."""
FITTED_CYCLES = 2
"""Mains cycles of the first fit: those of the other quantities."""
_HARMONICS = 25  # EN 50160 tabulates harmonics up to here
SLOW_WALK, FAST_WALK = 2.0, 200.0
"""Standard deviation of what f walks by in the stretch [Hz], per noise-to-signal ratio (RMS) of the samples."""
_STEP_S = 0.002  # between the instants at which f may step


@dataclass(frozen=True, slots=True)
class Trial:
    """Vectors over `samples` samples."""

    projection: Floats
    """[8, samples]: voltage times this is Re c, -Im c of the fundamental and Re d, -Im d of its derivative over two
    cycles, and twice Re d, -Im d of what it changes by between their ends, per second: slow and fast walk."""
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
    time = (np.arange(samples) + 0.5 - (start + stop) / 2) / rate  # from the middle of the cycles
    highest = min(_HARMONICS, int(0.48 * rate / f))
    fundamental = np.exp(2j * np.pi * f * time)[:, None]
    harmonics = np.multiply.accumulate(np.broadcast_to(fundamental, (samples, highest)), axis=1)
    cos, sin = harmonics.real, harmonics.imag
    span = samples / rate / 2  # keeps the slope columns of the same size as the others
    slope = time[:, None] / span * np.column_stack((cos[:, 0], sin[:, 0]))
    basis = np.column_stack((cos[:, :1], sin[:, :1], slope, np.ones_like(time), cos[:, 1:], sin[:, 1:]))
    cycles = _least_squares(basis, _hump(samples, start, stop))
    cycles[:, 2:] /= span
    rows = np.column_stack((cycles, *_turns(f, rate, samples, highest, start, stop)))
    turn = np.ascontiguousarray(np.stack((cos[:, 0], sin[:, 0])))
    end = np.linspace(rate / f, samples, CYCLES)
    edges = np.stack((end - rate / f, end))
    return Trial(np.ascontiguousarray(rows.T), turn, edges, _phasors(turn, edges))


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


def _turns(f: float, rate: float, samples: int, highest: int, start: float, stop: float) -> list[Floats]:
    """[samples, 2] each, slow and fast walk: a signal times this is Re and -Im of what the fundamental changes by from
    start to stop [samples], per second; its phase counts from the middle between them.

    Harmonics may change at a steady rate, as they do where f lies between two trials. Columns that are even about the
    middle of the stretch are orthogonal to odd ones, and the two kinds are fitted one after the other.
    """
    time: Floats = (np.arange(samples, dtype=np.float64) + 0.5 - samples / 2) / rate
    edges = (np.array((start, stop)) - samples / 2) / rate
    steps: Floats = np.arange(_STEP_S, time[-1], _STEP_S, dtype=np.float64)
    turn = 2 * np.pi * f * np.outer(time, np.arange(1, highest + 1))
    cos, sin = np.cos(turn), np.sin(turn)
    drift = time[:, None] * 10
    one = np.ones((samples, 1))
    parts = []
    for even in (True, False):
        shape, other = _envelope(time, steps, even), _envelope(time, steps, not even)
        free = (one, cos[:, 1:], drift * sin[:, 1:]) if even else (sin[:, 1:], drift * cos[:, 1:])
        columns = np.column_stack((shape * cos[:, :1], other * sin[:, :1], *free))
        asked = np.zeros((columns.shape[1], 2))
        walks = np.zeros(columns.shape[1])
        count = shape.shape[1]
        for first, what, envelope in (
            (0, 0, _envelope(edges, steps, even)),
            (count, 1, _envelope(edges, steps, not even)),
        ):
            asked[first : first + count, what] = np.diff(envelope, axis=0)[0] / (edges[1] - edges[0])
            walks[first + 1 : first + count] = 1
        parts.append((columns, _normal(columns), asked, walks))
    angle = 2 * np.pi * f * edges.mean()
    rotation = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    result = []
    for walk in (SLOW_WALK, FAST_WALK):
        penalty = (2 * len(steps) + 1) / (2 * (2 * np.pi * walk) ** 2)
        even_fit, odd_fit = (
            columns @ np.linalg.solve(normal + penalty * np.diag(walks), asked)
            for columns, normal, asked, walks in parts
        )
        result.append(np.asarray((even_fit + odd_fit) @ rotation))
    return result


def _envelope(time: Floats, steps: Floats, even: bool) -> Floats:
    """[time, 1 + steps] of what the fundamental is multiplied by while f steps at 0, steps and -steps [s]: the even or
    odd part. The first column is the level, or f at the time 0; the others are penalised.
    """
    before, after = np.abs(time[:, None] + steps), np.abs(time[:, None] - steps)
    first = np.ones_like(time) if even else time
    return np.column_stack((first, (after + before if even else after - before) / np.sqrt(8)))


def _normal(columns: Floats) -> Floats:
    """Products of columns that are even, or odd, about the middle: twice those of a half."""
    middle, odd = divmod(len(columns), 2)
    half = columns[middle:].copy()
    half[odd:] *= np.sqrt(2)
    # not with BLAS, whose threads take longer to begin than this takes
    return np.asarray(np.einsum("nj,nk->jk", half, half))


def _phasors(turn: Floats, edges: Floats) -> Floats:
    begin, end = edges
    samples = np.arange(turn.shape[1])[:, None]
    inside = np.clip(end - samples, 0, 1) - np.clip(begin - samples, 0, 1)  # edges share a sample
    return np.asarray(turn.T[:, :, None] * inside[:, None, :])
