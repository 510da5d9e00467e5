"""Evidence of hypotheses: the marginal likelihood of a candidate's columns, with everything else projected out.

A candidate has coefficients theta ~ N(0, D^2) within physical bounds. With the Schur complement S of its columns and
their products h with the residual, twice the log Bayes factor against no candidate is

    E = h' (S + D^-2)^-1 h - log det(I + D S D) + 2 log(P(bounds | posterior) / P(bounds | prior))

(Kass and Raftery 1995). What the noise model gets wrong makes a likelihood overconfident: rows count with a learning
rate, which the reference recordings show (`spread`; Gruenwald 2012). Effects are equally likely beforehand, and so are
the places and shapes of an effect: the evidence of one of n pays 2 log n (ADR 26).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Information, TwoWitnesses
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import LEAST_POWER, Competition, Regression
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.numerics import solve_scaled_ridge

_RIDGE = 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """A candidate under a gate, with its coefficients. A finding equals itself only: coefficients are arrays."""

    candidate: Candidate
    coefficients: Floats
    """Posterior mean, within the physical bounds."""
    deviation: Floats
    """Posterior standard deviations, without the error of the columns."""
    evidence: float
    """Twice the log Bayes factor against no effect, what was searched for paid."""
    at_joints: float = 0.0
    """Part of the evidence that logged torques contribute; negative where they contradict the power."""
    witnesses: TwoWitnesses | None = None
    """Of the size, coefficients in proportion; None where logged torques say nothing about it."""
    forbidden: float = 0.0
    """Evidence that sizes beyond their physical bounds add to those within."""


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows that hypotheses are judged in: a design, what competes in it, and how far its rows can be trusted."""

    design: Design
    regression: Regression
    learning_rate: float

    def on(self, design: Design) -> Rows:
        """The same on a design with more columns."""
        return Rows(design, self.regression.on(design.blocks), self.learning_rate)


@dataclass(frozen=True, slots=True)
class _Contest:
    """Candidates that compete under a gate; their columns are taken from the Gram matrices once."""

    used: Indices
    positions: list[Indices]
    """Per candidate: indices into `used`."""

    @classmethod
    def of(cls, candidates: list[Candidate]) -> _Contest:
        used = np.unique(np.concatenate([candidate.indices for candidate in candidates]))
        return cls(used, [np.searchsorted(used, candidate.indices) for candidate in candidates])


def ranked(rows: Rows, gate: Floats, candidates: list[Candidate], weights: Floats | None = None) -> list[Finding]:
    """Findings of all candidates that act under a gate [blocks], the largest evidence first.

    `weights` [blocks]: how often a block counts, as in `Regression.compete`.
    """
    if not candidates:
        return []
    contest = _Contest.of(candidates)
    competition = rows.regression.compete(contest.used, gate, weights)
    counted = gate if weights is None else gate * weights
    findings = _judged(rows, contest, competition, candidates, counted)
    return sorted(findings, key=lambda finding: -finding.evidence)


def gains(rows: Rows, gate: Floats, findings: list[Finding]) -> tuple[list[str], Floats]:
    """Recordings under a gate, and [findings, recordings] the reduction of the white squared error in each of them."""
    design, regression = rows.design, rows.regression
    contest = _Contest.of([finding.candidate for finding in findings])
    competition = regression.compete(contest.used, gate)
    names = sorted({part.recording for part, acts in zip(design.parts, gate, strict=True) if acts})
    values = np.zeros((len(findings), len(names)))
    for number, name in enumerate(names):
        blocks = np.array([k for k, part in enumerate(design.parts) if gate[k] and part.recording == name])
        Q, s = regression.products_in(competition, contest.used, gate, blocks)
        for k, (finding, columns) in enumerate(zip(findings, contest.positions, strict=True)):
            Qk, sk = part_of(Q, s, columns, finding.candidate)
            theta = finding.coefficients
            values[k, number] = rows.learning_rate * float(2 * theta @ sk - theta @ Qk @ theta)
    return names, values


def part_of(schur: Floats, products: Floats, positions: Indices, candidate: Candidate) -> tuple[Floats, Floats]:
    """Schur complement and products of a candidate's parameters; `own`: indices of its columns in those."""
    schur, products = schur[np.ix_(positions, positions)], products[positions]
    if candidate.mix is not None:
        schur, products = candidate.mix.T @ schur @ candidate.mix, candidate.mix.T @ products
    return schur, products


def solve_part(schur: Floats, products: Floats) -> Floats:
    """Coefficients of candidates that compete with each other only."""
    return solve_scaled_ridge(schur, products, _RIDGE)


def acts(schur: Floats) -> bool:
    """False for columns that never act under the gate, or that the regression explains already."""
    return bool(schur.size and np.diag(schur).min() >= LEAST_POWER)


def _judged(
    rows: Rows, contest: _Contest, competition: Competition, candidates: list[Candidate], weights: Floats
) -> Iterator[Finding]:
    """A finding of every candidate that acts; `weights` [blocks]."""
    design, rate = rows.design, rows.learning_rate
    deviations = prior_deviations(design, contest.used)
    searched = float(np.log(max(float(design.blocks.rows @ (weights > 0)), 2.0)))
    acting: dict[int, list[_Acting]] = {}
    for candidate, positions in zip(candidates, contest.positions, strict=True):
        schur, products = part_of(competition.schur, competition.products, positions, candidate)
        if not acts(schur):
            continue
        S, h = rate * schur, rate * products
        at_joints = design.at_joints(candidate, weights)
        if at_joints is not None:
            S, h = S + at_joints.precision, h + at_joints.product
        D = _deviations(candidate, deviations[positions])
        acting.setdefault(len(h), []).append(_Acting(candidate, at_joints, S, h, D, *bounds_of(candidate)))
    for each in acting.values():  # as many parameters at once
        S, h, D, low, high = (np.stack(values) for values in zip(*(one[2:] for one in each), strict=True))
        for one, theta, deviation, evidence in zip(each, *posterior(S, h, D, low, high), strict=True):
            candidate = one.candidate
            paid = 2 * np.log(candidate.tried) + candidate.cost * searched + rate * candidate.usual
            joints = 0.0 if one.at_joints is None else one.at_joints.gain(theta)
            forbidden = beyond_bounds(one.S + np.diag(one.D**-2.0), one.h, theta)
            yield Finding(
                candidate, theta, deviation, float(evidence - paid), joints, _witnesses(one, theta), forbidden
            )


class _Acting(NamedTuple):
    """A candidate that acts, as `posterior` takes it."""

    candidate: Candidate
    at_joints: Information | None
    S: Floats
    h: Floats
    D: Floats
    low: Floats
    high: Floats


def _witnesses(one: _Acting, theta: Floats) -> TwoWitnesses | None:
    """Of both, along coefficients [k]; None where one of them says nothing."""
    if one.at_joints is None:
        return None
    torques, of_torques = one.at_joints.along(theta), float(theta @ one.at_joints.product)
    power, of_power = float(theta @ one.S @ theta) - torques, float(theta @ one.h) - of_torques
    if min(power, torques) <= 0:
        return None
    return TwoWitnesses(power, torques, of_power / power, of_torques / torques)


def posterior(S: Floats, h: Floats, D: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats]:
    """Means [..., k], standard deviations [..., k], and twice the log Bayes factor [...] against zero.

    S [..., k, k] precision and h [..., k] product of the likelihood, D [..., k] deviations of the normal prior, which
    is truncated to [low, high]. The probability of the bounds is that of independent coefficients; the mean lies within
    them.
    """
    A = np.eye(D.shape[-1]) + D[..., :, None] * S * D[..., None, :]
    covariance = D[..., :, None] * np.linalg.inv(A) * D[..., None, :]
    theta = (covariance @ h[..., None])[..., 0]
    deviation = np.sqrt(np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), 0.0))
    inside = _log_inside(theta, deviation, low, high) - _log_inside(np.zeros_like(D), D, low, high)
    bounded = np.isfinite(low) | np.isfinite(high)
    evidence = (h * theta).sum(-1) - np.linalg.slogdet(A)[1] + 2 * np.where(bounded, inside, 0.0).sum(-1)
    for at in map(tuple, np.argwhere(((theta < low) | (theta > high)).any(-1))):
        theta[at] = within(A[at] / np.outer(D[at], D[at]), h[at], theta[at], low[at], high[at])
    return theta, deviation, np.asarray(evidence)


def beyond_bounds(precision: Floats, h: Floats, theta: Floats) -> float:
    """Evidence that rests on impossible sizes: of coefficients without bounds, above theta [k], the likeliest within.

    Zero where no bound holds a coefficient.
    """
    return float(h @ np.linalg.solve(precision, h) - 2 * h @ theta + theta @ precision @ theta)


def _log_inside(mean: Floats, deviation: Floats, low: Floats, high: Floats) -> Floats:
    """[k] log of a normal probability between two bounds, also far outside of them."""
    deviation = np.maximum(deviation, 1e-12)
    a, b = (low - mean) / deviation, (high - mean) / deviation
    swap = a > 0  # by symmetry in the lower tail, where the logarithms are exact
    a, b = np.where(swap, -b, a), np.where(swap, -a, b)
    upper, lower = log_ndtr(b), log_ndtr(a)
    return np.asarray(upper + np.log1p(-np.exp(np.minimum(lower - upper, -1e-12))))


def within(precision: Floats, h: Floats, theta: Floats, low: Floats, high: Floats) -> Floats:
    """The likeliest coefficients within bounds: what lies outside moves to its bound, the others follow."""
    fixed = np.zeros(len(theta), dtype=bool)
    for _ in range(len(theta)):
        outside = ~fixed & ((theta < low) | (theta > high))
        if not outside.any():
            break
        fixed |= outside
        theta = np.clip(theta, low, high)
        free = ~fixed
        if free.any():
            rest = h[free] - precision[np.ix_(free, fixed)] @ theta[fixed]
            theta[free] = solve_part(precision[np.ix_(free, free)], rest)
    return np.clip(theta, low, high)


def prior_of(design: Design, candidate: Candidate) -> Floats:
    """[k] prior deviations of a candidate's parameters."""
    return _deviations(candidate, prior_deviations(design, candidate.indices))


def prior_deviations(design: Design, indices: Indices) -> Floats:
    """[indices] coefficient with which a column draws `largest_change` of the dynamic range (RMS) in question."""
    squares = np.zeros(len(indices))
    rows = 0.0
    for number, part in enumerate(design.parts):
        if part.in_question:
            squares += design.blocks.squares[number, indices]
            rows += design.blocks.rows[number]
    rms = np.sqrt(squares / max(rows, 1.0))
    return np.asarray(THRESHOLDS.largest_change * design.columns.dynamic_range / np.maximum(rms, 1e-9))


def _deviations(candidate: Candidate, of_columns: Floats) -> Floats:
    """[k] prior deviations of a candidate's parameters: the described ones, or those by their power."""
    if candidate.mix is not None:  # a parameter acts on several columns: their powers add
        of_columns = 1 / np.sqrt((np.asarray(candidate.mix) ** 2).T @ of_columns**-2.0)
    if candidate.variant is None:
        return of_columns
    described = np.array([parameter.deviation for parameter in candidate.variant.place.parameters])
    return np.where(np.isfinite(described), described, of_columns)


def bounds_of(candidate: Candidate) -> tuple[Floats, Floats]:
    """[k] physical bounds of a candidate's parameters."""
    if candidate.variant is None:
        return np.full(candidate.size, -np.inf), np.full(candidate.size, np.inf)
    parameters = candidate.variant.place.parameters
    return np.array([p.low for p in parameters]), np.array([p.high for p in parameters])
