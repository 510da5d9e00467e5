"""Loads that are either on or off, detected in the residual: when, and how much.

The path of on and off is the Viterbi path in white noise. The response of the whitener to a step is known, so that
every row has a likelihood that the load switches there. The level may vary in time: 1 for a load in the cabinet, the
power of 1 N for a contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from acqd.arrays import Floats
from acqd.discrepancy.loads.edges import shares_of_rows
from acqd.discrepancy.loads.paths import lasting, likeliest
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener

_SIZES = (1.0, 2.0, 4.0, 8.0, 16.0)  # starting values of the size, in standard deviations of the innovation
_ROUNDS = 4
_PRICE = math.log(NOISE.block_rows)
"""Log-likelihood that a switching pays: beforehand it may happen in any row of a minute."""
SLOW = 100
"""Shortest state of heaters, coolers and compressors, rows."""
_DWELLS = (10, SLOW)  # shortest state in rows; 10: equipment in use


@dataclass(frozen=True, slots=True)
class States:
    """On and off in all segments."""

    on: list[NDArray[np.bool_]]
    """[T] per segment."""
    shares: list[Floats]
    """[T] per segment: share of every row in which the load is on; 0 or 1 except where the load switches."""
    size: float
    """Difference between on and off, in W or units of the shape."""
    gain: float
    """Penalised log-likelihood ratio of the path against always off."""

    @property
    def edges(self) -> list[int]:
        """Number of switchings in every segment."""
        return [int(np.abs(np.diff(on.astype(int))).sum()) for on in self.on]

    @property
    def switchings(self) -> int:
        """Number of switchings in all segments."""
        return sum(self.edges)

    @property
    def share(self) -> float:
        """Share of rows that are on."""
        return float(np.concatenate(self.on).mean())


@dataclass(frozen=True, slots=True)
class _White:
    """A segment after whitening; row k is row k + order of the segment."""

    residual: Floats
    level: Floats
    """The whitened shape."""
    step: Floats
    """Product of the residual with the transient of a step at the row, times the shape there."""
    cost: Floats
    """Square of the transient."""
    cross: Floats
    """Product of the transient with `level`."""


def search(
    residuals: list[Floats],
    whitener: Whitener,
    shapes: list[Floats] | None = None,
    signs: tuple[int, ...] = (1,),
    dwells: tuple[int, ...] = _DWELLS,
) -> States | None:
    """The likeliest states of residuals [T] W per segment; None if no switching pays its price."""
    shapes = shapes or [np.ones(len(each)) for each in residuals]
    rms = float(np.sqrt(np.mean(np.concatenate(shapes) ** 2)))
    unit = whitener.innovation / max(rms, 1e-9)
    starts = [sign * size * unit for size in _SIZES for sign in signs]
    states = _likeliest(residuals, whitener, shapes, starts, dwells, _ROUNDS)
    rarest = THRESHOLDS.switching_rarest
    return states if states is not None and rarest < states.share < 1 - rarest else None


def states_of(residuals: list[Floats], whitener: Whitener, size: float, dwell: int) -> States | None:
    """The likeliest states of a load whose size in W is known, or None."""
    return _likeliest(residuals, whitener, [np.ones(len(each)) for each in residuals], [size], (dwell,), 1)


def _likeliest(
    everywhere: list[Floats],
    whitener: Whitener,
    levels: list[Floats],
    starts: list[float],
    dwells: tuple[int, ...],
    rounds: int,
) -> States | None:
    lost = len(whitener.taps) - 1
    long = [k for k, each in enumerate(everywhere) if len(each) > 2 * lost]  # in shorter segments the load stays off
    white = [_prepared(everywhere[k], levels[k], whitener) for k in long]
    best: _Optimum | None = None
    for dwell in dwells if long else ():
        for found in _settle(white, starts, dwell, rounds):
            if found.gain > 0 and (best is None or found.gain > best.gain):
                best = found
    if best is None:
        return None
    on = [np.zeros(len(each), dtype=bool) for each in everywhere]
    for k, path in zip(long, best.paths, strict=True):
        on[k] = np.concatenate([np.full(lost, path[0]), path])
    shares, size = shares_of_rows(everywhere, whitener, levels, on, best.size)
    return States(on, shares, size, best.gain)


@dataclass(frozen=True, slots=True)
class _Optimum:
    """A local optimum."""

    gain: float
    size: float
    paths: list[NDArray[np.bool_]]


def _prepared(residual: Floats, shape: Floats, whitener: Whitener) -> _White:
    lost = len(whitener.taps) - 1
    w = whitener.apply(residual)
    level = whitener.apply(shape)
    response = np.cumsum(whitener.taps)
    transient = (response - response[-1])[:-1]
    ahead = np.concatenate([w, np.zeros(lost)])
    level_ahead = np.concatenate([level, np.zeros(lost)])
    z = np.correlate(ahead, transient, "valid")[: len(w)]
    cross = np.correlate(level_ahead, transient, "valid")[: len(w)]
    c = shape[lost:]
    return _White(w, level, c * z, c**2 * float(transient @ transient), c * cross)


def _settle(white: list[_White], starts: list[float], dwell: int, rounds: int) -> list[_Optimum]:
    """Alternate between path and size, from every starting value."""
    sizes = np.array(starts)
    found: list[_Optimum | None] = [None] * len(starts)
    alive = np.arange(len(starts))
    for _ in range(rounds):
        going = []
        for k in alive:
            paths = [lasting(_path(each, float(sizes[k])), dwell) for each in white]
            gain = sum(_gain(each, path, sizes[k]) for each, path in zip(white, paths, strict=True))
            found[k] = _Optimum(gain, float(sizes[k]), paths)
            again = _level(white, paths)
            if again * sizes[k] > 0 and abs(again - sizes[k]) > 1e-2 * abs(sizes[k]):
                sizes[k] = again
                going.append(k)
        alive = np.array(going, dtype=int)
        if not len(alive):
            break
    return [each for each in found if each is not None]


def _level(white: list[_White], paths: list[NDArray[np.bool_]]) -> float:
    """Least-squares size for a path."""
    projected = energy = 0.0
    for each, path in zip(white, paths, strict=True):
        change = np.diff(path.astype(int), prepend=int(path[0]))
        rises, falls = change > 0, change < 0
        projected += float((each.residual * each.level)[path].sum() + each.step[rises].sum() - each.step[falls].sum())
        energy += float((each.level**2)[path].sum() + each.cost[change != 0].sum() + 2 * each.cross[rises].sum())
    return projected / energy if energy > 1e-9 else 0.0


def _gain(white: _White, path: NDArray[np.bool_], size: float) -> float:
    """Penalised log-likelihood ratio of the path against always off."""
    half = size * size / 2
    change = np.diff(path.astype(int), prepend=int(path[0]))
    rises, switched = change > 0, change != 0
    gain = size * (white.residual * white.level)[path].sum() - half * (white.level**2)[path].sum()
    gain += size * (white.step[rises].sum() - white.step[change < 0].sum()) - half * white.cost[switched].sum()
    return float(gain - size * size * white.cross[rises].sum() - _PRICE * switched.sum())


def _path(white: _White, size: float) -> NDArray[np.bool_]:
    """Viterbi path of a stretch for a size."""
    half = size * size / 2
    return likeliest(
        size * white.residual * white.level - half * white.level**2,
        size * white.step - half * white.cost - 2 * half * white.cross - _PRICE,
        -size * white.step - half * white.cost - _PRICE,
    )


def walks(residuals: list[Floats], on: list[NDArray[np.bool_]], rows: int) -> bool:
    """Whether a moving average over `rows` rows explains more of the residuals [T] W per segment than the states do.

    A slow walk has an on/off path too, but it also drifts within the states; a switching load has two levels.
    """
    left_by_states = left_by_average = 0.0
    together = np.concatenate(residuals)
    state = np.concatenate(on)
    levels = np.where(state, together[state].mean(), together[~state].mean())
    left_by_states = float(((together - levels) ** 2).sum())
    for each in residuals:
        width = min(rows, len(each))
        average = uniform_filter1d(each, width, mode="nearest")
        left_by_average += float(((each - average) ** 2).sum()) * (1 + 1 / width)
    return left_by_average < left_by_states
