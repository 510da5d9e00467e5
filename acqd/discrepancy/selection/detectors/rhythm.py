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
_DRAWS = 60
"""Loads of either kind that a load is compared with."""
_REGULAR, _IRREGULAR = (0.03, 0.1, 0.15), (0.3, 0.6, 1.0)
"""Standard deviations of dwell times over their mean: of thermostats, and of equipment in use."""

States = list[NDArray[np.bool_]]

_FEWEST_PAIRS = 100
"""Pairs of states for a correlation at a distance in time."""


@dataclass(frozen=True, slots=True)
class Rhythm:
    """How regular a load switches."""

    period_s: float
    """The likeliest period; 0 where nothing repeats."""
    probability: float
    """That the load has a rhythm, if both kinds are equally likely beforehand."""

    @property
    def likely(self) -> bool:
        """Whether a rhythm is likelier than none."""
        return 2 * self.probability > 1


def rhythm(on: States, t: list[Floats]) -> Rhythm:
    """Of states `on` [T] at the times `t` [T] in s per segment.

    Regular states correlate positively a period apart and as much negatively half a period apart. How large that
    correlation is depends on the duty cycle, and on the cycles that were seen: the same search in simulated loads with
    the same mean dwell times says how often a thermostat is no more regular than this load, and how often equipment in
    use is no less (surrogate data, Theiler et al. 1992). The odds are the ratio of both.
    """
    grid = _Grid.of(t)
    period_s, regularity = grid.most_regular(grid.states(on))
    means_s = _mean_dwell_s(on, t)
    random = np.random.default_rng(1)
    as_thermostat, as_equipment = (
        np.array(
            [grid.most_regular(grid.drawn(means_s, scatters[k % len(scatters)], random))[1] for k in range(_DRAWS)]
        )
        for scatters in (_REGULAR, _IRREGULAR)
    )
    thermostat, equipment = 1 + (as_thermostat <= regularity).sum(), 1 + (as_equipment >= regularity).sum()
    return Rhythm(period_s, float(thermostat / (thermostat + equipment)))


@dataclass(frozen=True, slots=True)
class _Grid:
    """Time in steps of 0.5 s. No phase lasts over a long gap between segments: such gaps are shortened."""

    places: list[NDArray[np.int_]]
    """[T] per segment."""
    known: Floats
    """[size] 1 where a segment has rows."""
    pairs: Floats
    """[size] number of pairs of known steps at every distance."""
    periods: Floats
    """That are compared, s."""

    @classmethod
    def of(cls, t: list[Floats]) -> _Grid:
        """From the times [T] in s of the segments."""
        places: list[NDArray[np.int_]] = [np.zeros(0, dtype=int)] * len(t)
        first, end_s = 0, float(min(each[0] for each in t))
        for k in sorted(range(len(t)), key=lambda k: float(t[k][0])):
            first += round(min(float(t[k][0]) - end_s, _LONGEST_PERIOD_S) / _GRID_S)
            places[k] = first + ((t[k] - t[k][0]) / _GRID_S).astype(int)
            first, end_s = int(places[k][-1]), float(t[k][-1])
        size = max(int(each[-1]) for each in places) + 1
        known = np.zeros(size)
        known[np.concatenate(places)] = 1.0
        observed_s = sum(float(each[-1] - each[0]) for each in t)
        longest = min(_LONGEST_PERIOD_S, size * _GRID_S / 2, observed_s / _FEWEST_CYCLES)
        periods = np.geomspace(_SHORTEST_PERIOD_S, max(longest, 2 * _SHORTEST_PERIOD_S), _PERIODS)
        return cls(places, known, _correlation(known), periods[np.rint(periods / _GRID_S) < size])

    def states(self, on: States) -> NDArray[np.bool_]:
        """[size] states `on` [T] per segment, False where nothing is known."""
        states = np.zeros(len(self.known), dtype=bool)
        for place, each in zip(self.places, on, strict=True):
            states[place] = each
        return states

    def drawn(self, means_s: tuple[float, float], scatter: float, random: np.random.Generator) -> NDArray[np.bool_]:
        """[size] states with dwell times from a gamma distribution, from a random moment on."""
        shape = scatter**-2.0
        cycles = int(len(self.known) * _GRID_S / sum(means_s) * (1 + scatter)) + 4
        ends = np.cumsum(random.gamma(shape, np.tile(means_s, cycles) / shape))
        states = np.searchsorted(ends, random.uniform(0, sum(means_s)) + np.arange(len(self.known)) * _GRID_S) % 2 == 1
        return np.asarray(states & (self.known > 0))

    def most_regular(self, on: NDArray[np.bool_]) -> tuple[float, float]:
        """Shortest period in s with nearly the largest regularity of states [size], and that regularity (0 to 1)."""
        mean = float(on.sum() / self.known.sum())
        if not 0 < mean < 1:
            return 0.0, 0.0
        products = _correlation((on - mean) * self.known)
        correlation = np.where(self.pairs > _FEWEST_PAIRS, products / np.maximum(self.pairs, 1), 0.0)
        correlation /= mean * (1 - mean)
        floor = min(mean, 1 - mean) / max(mean, 1 - mean)  # a square wave has no less than -d / (1 - d)
        whole, half = (np.rint(self.periods / _GRID_S / part).astype(int) for part in (1, 2))
        regular = np.minimum(correlation[whole], -correlation[half] / floor)
        most = max(float(regular.max(initial=0.0)), 0.0)
        first = int(np.argmax(regular >= THRESHOLDS.rhythm_near_best * most))
        return (float(self.periods[first]), float(regular[first])) if most > 0 else (0.0, 0.0)


def _correlation(values: Floats) -> Floats:
    """[size] sum of products of values [size] at every distance."""
    length = 2 ** int(np.ceil(np.log2(2 * len(values))))
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(values, length)) ** 2)[: len(values)])


def _mean_dwell_s(on: States, t: list[Floats]) -> tuple[float, float]:
    """Mean length of the states off and on, s; states at the ends count as half a state."""
    step_s = float(np.median(np.concatenate([np.diff(each) for each in t])))
    rows = [sum(int((states == value).sum()) for states in on) for value in (False, True)]
    starts = sum(0.5 * (1 + int(np.abs(np.diff(states.astype(int))).sum())) for states in on)
    return step_s * rows[0] / max(starts, 1.0), step_s * rows[1] / max(starts, 1.0)
