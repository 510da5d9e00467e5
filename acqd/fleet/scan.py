"""Kulldorff's scan statistic over kinds of causes and windows of time.

Where causes occur by themselves, each of m findings has a kind by its base rate and an onset that is uniform over the
time in which its robot was watched. For a kind and a window with c findings where E are expected, the log-likelihood
ratio is c log(c/E) + (m-c) log((m-c)/(m-E)), and 0 for c <= E (Kulldorff 1997). The largest ratio over all kinds and
windows is compared with those of simulated findings: one p-value, whatever the number of kinds and windows
(Monte Carlo test, Dwass 1957).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

DRAWS = 999


@dataclass(frozen=True, slots=True)
class Finding:
    """A cause that was found in a robot."""

    robot: str
    kind: str
    onset_s: float | None
    """UTC; None: between the training and the first recording in question."""
    trained_s: float
    """UTC of the end of the recordings of the training."""
    last_s: float
    """UTC of the end of the last recording."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """More findings of a kind than chance explains."""

    kind: str
    robots: tuple[str, ...]
    window_s: tuple[float, float] | None
    """UTC of the first and the last onset; None: at any time."""
    expected: float
    """Findings of this kind in a window of this length that are expected by chance."""
    p: float


def clusters(
    findings: Sequence[Finding], weights: Mapping[str, float], lengths_s: Sequence[float], chance: float, seed: int
) -> list[Cluster]:
    """Clusters with p <= `chance`, the likeliest first; each is removed before the next is searched.

    `weights`: base rates of the kinds, in any unit; a kind that is not among them has weight 1.
    """
    left, found = list(findings), []
    while len(left) > 1:
        rates = _rates(left, weights)
        best, ratio = _likeliest(left, rates, lengths_s)
        if best is None:
            break
        p = _chance(left, rates, lengths_s, ratio, seed)
        if p > chance:
            break
        found.append(Cluster(best.kind, best.robots, best.window_s, best.expected, p))
        left = [each for each in left if each.kind != best.kind or each.robot not in best.robots]
    return found


def _rates(findings: Sequence[Finding], weights: Mapping[str, float]) -> dict[str, float]:
    """Base rates that sum to 1."""
    every = {each.kind: 1.0 for each in findings} | dict(weights)
    total = sum(every.values())
    return {kind: weight / total for kind, weight in every.items()}


def _likeliest(
    findings: Sequence[Finding], rates: Mapping[str, float], lengths_s: Sequence[float]
) -> tuple[Cluster | None, float]:
    """The kind and window with the largest ratio; None where none has more than one finding."""
    kinds = np.array([each.kind for each in findings])
    onsets = np.array([np.nan if each.onset_s is None else each.onset_s for each in findings])
    best, highest = None, 0.0
    for kind in sorted(set(kinds.tolist())):
        own = np.flatnonzero(kinds == kind)
        ratio, window, expected = _best_window(onsets[own], rates[kind], findings, lengths_s)
        if ratio > highest:
            inside = own if window is None else own[(onsets[own] >= window[0]) & (onsets[own] <= window[1])]
            names = tuple(findings[k].robot for k in inside)
            span = None if window is None else (float(onsets[inside].min()), float(onsets[inside].max()))
            best, highest = Cluster(kind, names, span, expected, 1.0), ratio
    return best, highest


def _best_window(
    onsets: Floats, rate: float, findings: Sequence[Finding], lengths_s: Sequence[float]
) -> tuple[float, tuple[float, float] | None, float]:
    """Largest ratio, its window (None: any time) and the expected number, of the onsets [c] of one kind."""
    total = len(findings)
    best: tuple[float, tuple[float, float] | None, float] = (
        _ratio(len(onsets), rate * total, total),
        None,
        rate * total,
    )
    known = np.sort(onsets[np.isfinite(onsets)])
    trained = np.array([each.trained_s for each in findings])
    last = np.array([each.last_s for each in findings])
    for length in lengths_s:
        counts = np.searchsorted(known, known + length, side="right") - np.arange(len(known))
        for k in np.flatnonzero(counts > 1):
            begin, end = float(known[k]), float(known[k] + length)
            shares = np.clip(np.minimum(last, end) - np.maximum(trained, begin), 0.0, None) / (last - trained)
            expected = rate * float(shares.sum())
            ratio = _ratio(int(counts[k]), expected, total)
            if ratio > best[0]:
                best = ratio, (begin, end), expected
    return best


def _ratio(count: int, expected: float, total: int) -> float:
    """Log-likelihood ratio; 0 for single findings and for no more than expected."""
    if count < 2 or count <= expected:
        return 0.0
    rest = total - count
    outside = rest * np.log(rest / (total - expected)) if rest else 0.0
    return float(count * np.log(count / max(expected, 1e-12)) + outside)


def _chance(
    findings: Sequence[Finding], rates: Mapping[str, float], lengths_s: Sequence[float], ratio: float, seed: int
) -> float:
    """Share of simulated fleets, with the observed one among them, whose largest ratio is as large."""
    random = np.random.default_rng(seed)
    names, shares = list(rates), np.array(list(rates.values()))
    known = np.array([each.onset_s is not None for each in findings])
    trained = np.array([each.trained_s for each in findings])
    last = np.array([each.last_s for each in findings])
    as_large = 1
    for _ in range(DRAWS):
        kinds = random.choice(len(names), len(findings), p=shares)
        onsets = np.where(known, random.uniform(trained, last), np.nan)
        several = [k for k, count in enumerate(np.bincount(kinds)) if count > 1]
        ratios = [_best_window(onsets[kinds == k], rates[names[k]], findings, lengths_s)[0] for k in several]
        largest = max(ratios, default=0.0)
        as_large += largest >= ratio
    return as_large / (DRAWS + 1)
