"""Whether a load switches in a rhythm: a thermostat does, equipment in use does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.discrepancy.thresholds import THRESHOLDS

_SHORTEST_PERIOD_S, _LONGEST_PERIOD_S = 2.0, 900.0
_FEWEST_CYCLES = 3
"""A rhythm must be seen three times."""
_GRID_S = 0.5
_PERIODS = 600
_DRAWS = 99
"""Irregular loads that a rhythm is compared with: the largest of 99 is exceeded by chance with 1 %."""
_SCATTER = 0.3
"""Standard deviation of the irregular loads' dwell times over their mean."""

States = list[NDArray[np.bool_]]

_FEWEST_PAIRS = 100
"""Pairs of states for a correlation at a distance in time."""


def rhythm(on: States, t: list[Floats]) -> float | None:
    """Period in s of states `on` [T] at the times `t` [T] in s per segment; None where they have no rhythm.

    Regular states correlate positively a period apart and as much negatively half a period apart. The same search
    finds some regularity in irregular states too, the more the fewer cycles were seen: a rhythm must be more regular
    than loads with the same mean dwell times that scatter by 30 % (surrogate data, Theiler et al. 1992).
    """
    grid = _Grid.of(t)
    period_s, regularity = grid.most_regular(on)
    if regularity <= THRESHOLDS.rhythm_regular:
        return None
    random = np.random.default_rng(1)
    mean_rows = _mean_dwell_rows(on)
    by_chance = max(grid.most_regular([_irregular(len(each), mean_rows, random) for each in on])[1]
                    for _ in range(_DRAWS))  # fmt: skip
    return period_s if regularity > by_chance else None


@dataclass(frozen=True, slots=True)
class _Grid:
    """Time in steps of 0.5 s. No phase lasts over a long gap between segments: such gaps are shortened."""

    places: list[NDArray[np.int_]]
    """[T] per segment."""
    size: int
    observed_s: float

    @classmethod
    def of(cls, t: list[Floats]) -> _Grid:
        """From the times [T] in s of the segments."""
        places: list[NDArray[np.int_]] = [np.zeros(0, dtype=int)] * len(t)
        first, end_s = 0, float(min(each[0] for each in t))
        for k in sorted(range(len(t)), key=lambda k: float(t[k][0])):
            first += round(min(float(t[k][0]) - end_s, _LONGEST_PERIOD_S) / _GRID_S)
            places[k] = first + ((t[k] - t[k][0]) / _GRID_S).astype(int)
            first, end_s = int(places[k][-1]), float(t[k][-1])
        return cls(places, max(int(each[-1]) for each in places) + 1, sum(float(each[-1] - each[0]) for each in t))

    def most_regular(self, on: States) -> tuple[float, float]:
        """Shortest period in s with nearly the largest regularity, and that regularity (0 to 1)."""
        known, state = np.zeros(self.size), np.zeros(self.size)
        mean = float(np.concatenate(on).mean())
        if not 0 < mean < 1:
            return 0.0, 0.0
        for states, place in zip(on, self.places, strict=True):
            known[place], state[place] = 1.0, states - mean
        correlation = _correlation(known, state) / (mean * (1 - mean))
        floor = min(mean, 1 - mean) / max(mean, 1 - mean)  # a square wave has no less than -d / (1 - d)
        longest = min(_LONGEST_PERIOD_S, self.size * _GRID_S / 2, self.observed_s / _FEWEST_CYCLES)
        periods = np.geomspace(_SHORTEST_PERIOD_S, max(longest, 2 * _SHORTEST_PERIOD_S), _PERIODS)
        whole, half = np.rint(periods / _GRID_S).astype(int), np.rint(periods / _GRID_S / 2).astype(int)
        inside = whole < self.size
        periods, whole, half = periods[inside], whole[inside], half[inside]
        regular = np.minimum(correlation[whole], -correlation[half] / floor)
        most = max(float(regular.max(initial=0.0)), 0.0)
        first = int(np.argmax(regular >= THRESHOLDS.rhythm_near_best * most))
        return (float(periods[first]), float(regular[first])) if most > 0 else (0.0, 0.0)


def _correlation(known: Floats, state: Floats) -> Floats:
    """[size] mean product of states at every distance; 0 where too few pairs are known."""
    length = 2 ** int(np.ceil(np.log2(2 * len(known))))
    products = np.fft.irfft(np.abs(np.fft.rfft(state, length)) ** 2)[: len(known)]
    pairs = np.fft.irfft(np.abs(np.fft.rfft(known, length)) ** 2)[: len(known)]
    return np.where(pairs > _FEWEST_PAIRS, products / np.maximum(pairs, 1), 0.0)


def _mean_dwell_rows(on: States) -> tuple[float, float]:
    """Mean length of the states off and on, in rows; states at the ends count as half a state."""
    rows = [sum(int((states == value).sum()) for states in on) for value in (False, True)]
    starts = sum(0.5 * (1 + int(np.abs(np.diff(states.astype(int))).sum())) for states in on)
    return rows[0] / max(starts, 1.0), rows[1] / max(starts, 1.0)


def _irregular(rows: int, mean_rows: tuple[float, float], random: np.random.Generator) -> NDArray[np.bool_]:
    """[rows] states with dwell times from a gamma distribution, from a random moment on."""
    shape = _SCATTER**-2.0
    cycles = int(rows / sum(mean_rows)) + 4
    dwell = random.gamma(shape, np.tile(mean_rows, cycles) / shape)
    start = random.uniform(0, sum(mean_rows))
    return np.asarray(np.searchsorted(np.cumsum(dwell), start + np.arange(rows), side="right") % 2, dtype=bool)
