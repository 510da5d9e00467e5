"""Loads that are either on or off, detected in the residual: when, and how much.

The path of on and off is the Viterbi path in white noise. The response of the whitener to a step is known, so that
every row has a likelihood that the load switches there. The level may vary in time: 1 for a load in the cabinet, the
power of 1 N for a contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from acqd.arrays import Floats
from acqd.discrepancy.loads.edges import shares_of_rows
from acqd.discrepancy.loads.paths import White, likeliest
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


def search(
    residuals: list[Floats],
    whitener: Whitener,
    shapes: list[Floats] | None = None,
    signs: tuple[int, ...] = (1,),
    dwells: tuple[int, ...] = _DWELLS,
    noise: list[Floats] | None = None,
) -> States | None:
    """The likeliest states of residuals [T] W per segment; None if no switching pays its price.

    `noise` [T]: standard deviations of white rows, relative to the noise model's.
    """
    shapes = shapes or [np.ones(len(each)) for each in residuals]
    rms = float(np.sqrt(np.mean(np.concatenate(shapes) ** 2)))
    unit = whitener.innovation / max(rms, 1e-9)
    starts = [sign * size * unit for size in _SIZES for sign in signs]
    states = _likeliest(residuals, whitener, shapes, starts, dwells, _ROUNDS, noise)
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
    noise: list[Floats] | None = None,
) -> States | None:
    noise = noise or [np.ones(len(each)) for each in everywhere]
    lost = len(whitener.taps) - 1
    long = [k for k, each in enumerate(everywhere) if len(each) > 2 * lost]  # in shorter segments the load stays off
    white = [_prepared(everywhere[k], levels[k], whitener, noise[k][lost:] ** -2) for k in long]
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


def _prepared(residual: Floats, shape: Floats, whitener: Whitener, weight: Floats) -> Floats:
    """[5, T - order] a `White`: row k is row k + order of the segment, whose square counts by its `weight`."""
    lost = len(whitener.taps) - 1
    w = whitener.apply(residual) * weight
    level = whitener.apply(shape)
    response = np.cumsum(whitener.taps)
    transient = (response - response[-1])[:-1]
    nothing = np.zeros(lost)
    z, cross, cost = (
        np.correlate(np.concatenate([rows, after]), seen, "valid")[: len(w)]
        for rows, after, seen in (
            (w, nothing, transient),
            (level * weight, nothing, transient),
            (weight, nothing + weight[-1], transient**2),
        )
    )
    c = shape[lost:]
    return np.stack(White(w * level, level**2 * weight, c * z, c**2 * cost, c * cross))


def _settle(white: list[Floats], starts: list[float], dwell: int, rounds: int) -> Iterator[_Optimum]:
    """Alternate between path and size, from every starting value."""
    for start in starts:
        size, optimum = start, None
        for _ in range(rounds):
            paths = [likeliest(each, size, _PRICE, dwell) for each in white]
            optimum = _Optimum(sum(path.gain for path in paths), size, [path.on for path in paths])
            projected, energy = sum(path.projected for path in paths), sum(path.energy for path in paths)
            again = projected / energy if energy > 1e-9 else 0.0
            if again * size <= 0 or abs(again - size) <= 1e-2 * abs(size):
                break
            size = again
        if optimum is not None:
            yield optimum


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
