"""Whether a load switches in a rhythm: a thermostat does, equipment in use does not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, gammaincc, gammaln, logsumexp

from acqd.arrays import Floats
from acqd.discrepancy.loads.paths import lasting

_SHORTEST_S, _A_DECADE = 1.0, 48
"""Mean lengths of a state that are compared, equally likely beforehand: up to twice what was recorded."""
_REGULAR, _IRREGULAR = (0.03, 0.1, 0.15), (0.3, 0.6, 1.0)
"""Standard deviations of dwell times over their mean: of thermostats, and of equipment in use."""
_STRAY = 0.05
"""Share of dwell times that are of any length: the residual hides some switchings."""
_GLITCHES_S = (0.0, 1.0, 2.0, 4.0, 8.0)
"""Longest states that noise makes, equally likely beforehand; 0: noise makes none."""
_BETWEEN_S = 60.0
"""Expected time between such states, before any was seen."""
_NEAR = np.geomspace(0.8, 1.25, 46)
"""Periods that are compared, relative to the one by the likeliest means."""
_CYCLES_IN_PHASE = 6
"""After so many cycles, dwell times that scatter have shifted the phase."""
_DIGITS = 3
"""Of stays in s: equal ones are computed once."""

States = list[NDArray[np.bool_]]


@dataclass(frozen=True, slots=True)
class Rhythm:
    """How regular a load switches."""

    period_s: float
    """The likeliest period of a thermostat."""
    probability: float
    """That the load has a rhythm, if both kinds are equally likely beforehand."""

    @property
    def likely(self) -> bool:
        """Whether a rhythm is likelier than none."""
        return 2 * self.probability > 1


@dataclass(frozen=True, slots=True)
class _Dwell:
    """A stay in a state, as far as it was seen."""

    on: bool
    seen_s: float
    hidden_s: float = 0.0
    """Of pauses of the recordings in which the stay began or ended: it lasted longer, by as much at most."""
    begun: bool = True
    """Whether its begin was seen."""
    ended: bool = True
    """Whether its end was seen, or lies in a pause."""


def rhythm(on: States, t: list[Floats]) -> Rhythm:
    """Of states `on` [T] at the times `t` [T] in s per segment.

    Both kinds are alternating renewal processes with gamma distributed dwell times (Cox 1962): those of a thermostat
    scatter little about the means of its two states, those of equipment much. The odds are the ratio of the
    likelihoods, averaged over means, scatters, and the longest state that is only noise. Stays that the ends of
    recordings cut count as far as they were seen.
    """
    seconds = sum(float(each[-1] - each[0]) for each in t)
    step_s = float(np.median(np.concatenate([np.diff(each) for each in t])))
    means_s = np.geomspace(_SHORTEST_S, 2 * seconds, 2 + int(_A_DECADE * np.log10(2 * seconds / _SHORTEST_S)))
    thermostat, equipment = list[_Fit](), list[_Fit]()
    for longest_s in _GLITCHES_S:
        clean = [lasting(each, round(longest_s / step_s)) for each in on]
        count = (_switchings(on) - _switchings(clean)) / 2
        noise = float(gammaln(count + 1) - count * np.log((seconds + _BETWEEN_S) * max(longest_s, step_s)))  # Poisson
        dwells = Counter(_dwells(clean, t, step_s))
        thermostat += [_fit(dwells, scatter, means_s, noise) for scatter in _REGULAR]
        equipment += [_fit(dwells, scatter, means_s, noise) for scatter in _IRREGULAR]
    odds = logsumexp([each.likelihood for each in thermostat]) - logsumexp([each.likelihood for each in equipment])
    return Rhythm(_in_phase(on, t, max(thermostat).period_s), float(expit(odds)))


class _Fit(NamedTuple):
    """Of a kind with one scatter."""

    likelihood: float
    """Its logarithm."""
    period_s: float
    """The likeliest."""


def _fit(dwells: Mapping[_Dwell, int], scatter: float, means_s: Floats, noise: float) -> _Fit:
    """In equilibrium, a stay that was under way has a density of its survival over the length of a cycle."""
    off, on = _log_likelihoods(dwells, scatter, means_s)
    cycle_s = means_s[:, None] + means_s
    under_way = sum(count for dwell, count in dwells.items() if not dwell.begun)
    by_means = off[:, None] + on - under_way * np.log(cycle_s)
    return _Fit(float(logsumexp(by_means)) + noise, float(cycle_s.flat[by_means.argmax()]))


def _in_phase(on: States, t: list[Floats], period_s: float) -> float:
    """The period near `period_s` with the largest amplitude: the phase lasts over pauses that cut stays."""
    time, states = np.concatenate(t), np.concatenate(on) - np.concatenate(on).mean()
    stretch = (time / (_CYCLES_IN_PHASE * period_s)).astype(int)
    stretch -= stretch.min()

    def power(near_s: float) -> float:
        wave = states * np.exp(2j * np.pi * (time - time[0]) / near_s)
        return float((np.bincount(stretch, wave.real) ** 2 + np.bincount(stretch, wave.imag) ** 2).sum())

    return float(max((period_s * _NEAR).tolist(), key=power))


def _switchings(on: States) -> int:
    return sum(int(np.abs(np.diff(each.astype(int))).sum()) for each in on)


def _dwells(on: States, t: list[Floats], step_s: float) -> Iterator[_Dwell]:
    """Stays in order of time. Pauses cut them, unless they are so short that no whole stay is likely to be within."""
    segments = [list(_runs(on[k], t[k], step_s)) for k in sorted(range(len(t)), key=lambda k: float(t[k][0]))]
    runs = [run for segment in segments for run in segment]
    whole: dict[bool, list[float]] = {}
    for state, start_s, end_s in (run for segment in segments for run in segment[1:-1]):
        whole.setdefault(state, []).append(end_s - start_s)
    bridged_s = min((float(np.median(each)) for each in whole.values()), default=0.0) / 2
    begun, hidden_s, first = False, 0.0, 0
    for number, ((state, _, end_s), (next_state, start_s, _)) in enumerate(pairwise(runs)):
        pause_s = start_s - end_s
        cut = pause_s > bridged_s
        if state == next_state and not cut:
            continue
        seen_s = round(end_s - runs[first][1], _DIGITS)
        yield _Dwell(state, seen_s, round(hidden_s + (0.0 if cut else pause_s), _DIGITS), begun, not cut)
        begun, hidden_s, first = not cut, 0.0 if cut else pause_s, number + 1
    yield _Dwell(runs[-1][0], round(runs[-1][2] - runs[first][1], _DIGITS), 0.0, begun, ended=False)


def _runs(on: NDArray[np.bool_], t: Floats, step_s: float) -> Iterator[tuple[bool, float, float]]:
    """State, begin and end [s] of every run of equal states of a segment."""
    ends_s = [*t.tolist(), float(t[-1]) + step_s]
    edges = [0, *(np.flatnonzero(np.diff(on.astype(int))) + 1).tolist(), len(on)]
    for first, last in pairwise(edges):
        yield bool(on[first]), ends_s[first], ends_s[last]


def _log_likelihoods(dwells: Mapping[_Dwell, int], scatter: float, means_s: Floats) -> Floats:
    """[2, means] log-likelihood of the stays off, and of those on, by their mean length."""
    total = np.zeros((2, len(means_s)))
    for dwell, count in dwells.items():
        regular, stray = _likelihood(dwell, scatter**-2.0, means_s), _likelihood(dwell, 1.0, means_s)
        total[int(dwell.on)] += count * np.log(np.maximum((1 - _STRAY) * regular + _STRAY * stray, 1e-300))
    return total


def _likelihood(dwell: _Dwell, shape: float, means_s: Floats) -> Floats:
    """[means] likelihood of a stay of a gamma distribution with so many degrees of freedom, by its mean.

    Of one that was under way, times the length of a cycle.
    """
    x = dwell.seen_s * shape / means_s
    lasts = gammaincc(shape, x)
    if not dwell.begun and not dwell.ended:  # E max(D - seen, 0)
        return np.asarray(means_s * (gammaincc(shape + 1, x) - x / shape * lasts))
    if not dwell.begun or not dwell.ended:
        return np.asarray(lasts)
    if dwell.hidden_s > 0:
        return np.asarray(lasts - gammaincc(shape, x + dwell.hidden_s * shape / means_s)) / dwell.hidden_s
    return np.asarray(np.exp(shape * np.log(x) - x - gammaln(shape)) / dwell.seen_s)
