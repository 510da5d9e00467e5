"""Confidence of a selected effect (Bayesian bootstrap over recordings) and intervals of its parameters (jackknife)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.selection.acceptance import discounted, outdone
from acqd.discrepancy.selection.accepted import Named, Tracing
from acqd.discrepancy.selection.hypotheses import unnamed
from acqd.discrepancy.selection.ranking import Finding, rank_pooled
from acqd.discrepancy.selection.shape_interval import Fit, Neighbours, fit_at
from acqd.discrepancy.selection.switched_size import sizes_by_levels, switches
from acqd.discrepancy.thresholds import THRESHOLDS

_SHOWN = 3  # alternatives in a report


def confidence(tracing: Tracing, named: Named, seed: int) -> tuple[float, list[tuple[str, float]]]:
    """Probability that other recordings would name the effect too, and the probabilities of its alternatives.

    Given all other selected effects, which are part of the explanation and no alternatives. Shares of resampled sets
    of recordings by the rule of succession (Laplace), so that 40 of 40 is no certainty. An unnamed alternative wins a
    set as it would win the recordings: if it explains clearly more.
    """
    design, regression = replace(tracing.design, witness=named.witness), tracing.regression.without(named.key)
    others = [other for other in tracing.effects if other.key != named.key]
    taken = {other.id for other in others}
    rivals = [finding.candidate for finding in named.alternatives if finding.candidate.id not in taken]
    candidates = [named.finding.candidate, *rivals]
    won = dict.fromkeys([_name(candidate) for candidate in candidates], 0)
    random = np.random.default_rng(seed)
    for _ in range(THRESHOLDS.resamples):
        ranked = rank_pooled(design, regression, named.gate.open, candidates, _resampled(design, random))
        winner = _winner(ranked, others)
        if winner is not None:
            won[_name(winner.candidate)] += 1
    total = sum(won.values()) + 2
    shares = [(name, times / total) for name, times in won.items() if name != named.id]
    return (won[named.id] + 1) / total, sorted(shares, key=lambda share: -share[1])[:_SHOWN]


def _winner(findings: list[Finding], others: list[Named]) -> Finding | None:
    """Of findings with the largest evidence first; what was found by searching pays as it does in the selection."""
    effect = max((finding for finding in findings if finding.candidate.id), key=discounted, default=None)
    doubt = next((finding for finding in findings if not finding.candidate.id), None)
    if doubt is None or (effect is not None and not outdone(effect, doubt, others)):
        return effect
    return doubt


def _name(candidate: Candidate) -> str:
    return candidate.id or unnamed(candidate.label)


def _resampled(design: Design, random: np.random.Generator) -> Floats:
    """[blocks] weights of a Bayesian bootstrap over the recordings of both sides (Rubin 1981).

    The weights of n recordings are n times a draw of Dirichlet's distribution. With replacement, one draw of three
    recordings in four would lack one of them, and with it the only cold gear or the only other load.
    """
    weights = np.zeros(len(design.parts))
    for side in (True, False):
        names = sorted({part.recording for part in design.parts if part.in_question == side})
        if names:
            times = dict(zip(names, len(names) * random.dirichlet(np.ones(len(names))), strict=True))
            weights += [times[part.recording] if part.in_question == side else 0.0 for part in design.parts]
    return weights


@dataclass(frozen=True, slots=True)
class Intervals:
    """Coefficients [k] and the value of a fitted shape, with half widths of their 95 % intervals."""

    coefficients: Floats
    half: Floats
    shape: float | None = None
    shape_half: float | None = None
    """None: no shape was fitted, or too few recordings."""


def intervals(tracing: Tracing, named: Named) -> Intervals:
    """Given all other selected effects.

    Delete-one-recording jackknife (Tukey 1958) with Student's factor, and at least the width for white noise. A
    fitted shape is fitted again without every recording, so that its uncertainty is in the size too.
    """
    blocks_in_question = int((named.gate.open > 0).sum())
    if switches(named) and blocks_in_question > 1:  # one block says nothing about the spread
        by_levels = sizes_by_levels(tracing.design, tracing.regression, named)
        spread = _jackknife([np.array([size]) for size in by_levels[1:]])
        return Intervals(by_levels[:1], float(student.ppf(0.975, len(by_levels) - 2)) * spread)
    design, regression = replace(tracing.design, witness=named.witness), tracing.regression.without(named.key)
    neighbours = Neighbours.of(design, regression, named)

    def fit(weights: Floats) -> Fit:
        if neighbours is not None:
            return neighbours.fit(weights)
        return fit_at(design, regression, named.finding.candidate, named.gate.open, weights)[1]

    whole = fit(np.ones(len(design.parts)))
    sizes = fit_at(design, regression, named.finding.candidate, named.gate.open, np.ones(len(design.parts)))[1]
    names = sorted({part.recording for part, open_ in zip(design.parts, named.gate.open, strict=True) if open_})
    left = [
        fit(np.array([float(not part.in_question or part.recording != name) for part in design.parts]))
        for name in names
    ]
    noise = THRESHOLDS.interval_width * np.sqrt(whole.variance)
    if len(left) < THRESHOLDS.jackknife_fewest:
        return Intervals(sizes.coefficients, noise, whole.shape)
    factor = float(student.ppf(0.975, len(left) - 1))
    half = np.hypot(factor * _jackknife([each.coefficients for each in left]), noise)
    if whole.shape is None:
        return Intervals(sizes.coefficients, half)
    spread = _jackknife([np.array([each.shape]) for each in left])
    return Intervals(sizes.coefficients, half, whole.shape, factor * float(spread[0]))


def _jackknife(left: list[Floats]) -> Floats:
    """[k] standard errors from estimates [k] without one recording each."""
    deviations = np.array(left) - np.mean(left, axis=0)
    return np.asarray(np.sqrt((len(left) - 1) / len(left) * (deviations**2).sum(axis=0)))
