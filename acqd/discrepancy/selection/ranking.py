"""Ranking of candidates: evidence, held-out gain, agreement of recordings, and how large a surprise is by chance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Competition, Places, Regression
from acqd.discrepancy.regression.level import UnknownLevel
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.numerics import quadratic_form, solve_scaled_ridge

_RIDGE = 1e-8


@dataclass(frozen=True, slots=True)
class Gain:
    """Reduction of a squared error on recordings that did not take part, W^2 rows."""

    total: float
    error: float
    """Standard error of the total, from the spread over recordings."""

    @classmethod
    def of(cls, gains: Floats) -> Gain:
        """From the gains of recordings [recordings]."""
        return cls(float(gains.sum()), float(gains.std() * np.sqrt(len(gains))))

    def sign(self) -> int:
        """-1 or 1 if the total is clearly negative or positive, else 0."""
        clear = abs(self.total) >= THRESHOLDS.plain_errors * self.error and self.total != 0
        return int(np.sign(self.total)) if clear else 0


@dataclass(frozen=True, slots=True)
class Support:
    """What single recordings say of a candidate."""

    gains: Floats
    """[recordings] reduction of the white squared error of a recording, by coefficients from the others."""
    plain: Gain
    """The same gains together, of the error in W."""
    varying: Gain
    """The same about the mean of every block: what a constant load of another cause cannot hide."""
    acting: int
    """Number of recordings in which the effect acts."""
    consistency: float
    """Share of those recordings that agree in sign with the pooled estimate."""
    surprise: float
    """-log of the probability of so much agreement by chance, for this candidate alone."""

    @property
    def held_out(self) -> float:
        """Reduction of the white squared error on recordings that did not take part."""
        return float(self.gains.sum())


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """A candidate under a gate, with its coefficients. A finding equals itself only: coefficients are arrays."""

    candidate: Candidate
    coefficients: Floats
    drop: float
    """Reduction of the white squared error, less the squares of coefficients over their prior deviations."""
    evidence: float
    """The drop minus k log n, what k free coefficients explain by chance (BIC, Schwarz 1978).

    Less 2 log s for the best of s shapes, which are equally likely beforehand: a cold gear that hardly warms up in the
    recordings explains what a higher viscous friction explains, and always a little more.
    """
    at_joints: float = 0.0
    """Part of the drop that logged torques contribute; negative where they contradict the power."""
    support: Support | None = None
    """None: not computed, the candidate was ranked on pooled recordings only."""

    def supported(self) -> Support:
        """The support. Raises ValueError when it was not computed."""
        if self.support is None:
            raise ValueError(f"{self.candidate.key}: ranked on pooled recordings only")
        return self.support


@dataclass(frozen=True, slots=True)
class _Contest:
    """Candidates that compete under a gate; their columns are taken from the Gram matrices once."""

    used: Places
    owns: list[Places]
    """Per candidate: indices into `used`."""

    @classmethod
    def of(cls, candidates: list[Candidate]) -> _Contest:
        used = np.unique(np.concatenate([candidate.places for candidate in candidates]))
        return cls(used, [np.searchsorted(used, candidate.places) for candidate in candidates])


def rank(design: Design, regression: Regression, gate: Floats, candidates: list[Candidate]) -> list[Finding]:
    """All possible candidates under a gate with their support, the largest evidence first."""
    contest = _Contest.of(candidates)
    competition = regression.compete(contest.used, gate)
    scores = regression.scores(competition, contest.used, gate)
    gains, plain, varying = _held_out(design, regression, gate, contest, candidates)
    findings = []
    for number, schur, finding in _pooled(design, contest, competition, candidates, gate):
        candidate = finding.candidate
        own = scores[:, contest.owns[number]]
        own = own if candidate.mix is None else own @ candidate.mix
        acting, consistency = _consistency(design, gate, candidate, own @ finding.coefficients)
        support = Support(
            gains=gains[number], plain=Gain.of(plain[number]), varying=Gain.of(varying[number]), acting=acting,
            consistency=consistency, surprise=_surprise(own, schur),
        )  # fmt: skip
        findings.append(replace(finding, support=support))
    return sorted(findings, key=lambda finding: -finding.evidence)


def rank_pooled(
    design: Design, regression: Regression, gate: Floats, candidates: list[Candidate], weights: Floats | None = None
) -> list[Finding]:
    """The ranking without support; `weights` [blocks] as in `Regression.compete`."""
    contest = _Contest.of(candidates)
    competition = regression.compete(contest.used, gate, weights)
    counted = gate if weights is None else gate * weights
    findings = [finding for _, _, finding in _pooled(design, contest, competition, candidates, counted)]
    return sorted(findings, key=lambda finding: -finding.evidence)


def chance(regression: Regression, gate: Floats, candidates: list[Candidate], seed: int) -> Floats:
    """[draws] the largest surprise of any candidate when the signs of whole blocks are random.

    Wild bootstrap with Rademacher signs (Liu 1988), blocks as clusters.
    """
    contest = _Contest.of(candidates)
    competition = regression.compete(contest.used, gate)
    scores = regression.scores(competition, contest.used, gate)
    draws = THRESHOLDS.chance_draws
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(draws, len(scores)))
    largest = np.zeros(draws)
    for candidate, own in zip(candidates, contest.owns, strict=True):
        schur, _ = part_of(competition.schur, competition.products, own, candidate)
        if not _acts(schur):
            continue
        E = scores[:, own] if candidate.mix is None else scores[:, own] @ candidate.mix
        V = E.T @ E + THRESHOLDS.score_ridge * schur
        statistic, rank = quadratic_form(V, signs @ E)
        largest = np.maximum(largest, -chi2.logsf(statistic, rank))
    return largest


def part_of(schur: Floats, products: Floats, own: Places, candidate: Candidate) -> tuple[Floats, Floats]:
    """Schur complement and products of a candidate's parameters; `own`: indices of its columns in those."""
    schur, products = schur[np.ix_(own, own)], products[own]
    if candidate.mix is not None:
        schur, products = candidate.mix.T @ schur @ candidate.mix, candidate.mix.T @ products
    return schur, products


def solve_part(schur: Floats, products: Floats) -> Floats:
    """Coefficients of candidates that compete with each other only."""
    return solve_scaled_ridge(schur, products, _RIDGE)


def _pooled(
    design: Design, contest: _Contest, competition: Competition, candidates: list[Candidate], weights: Floats
) -> Iterator[tuple[int, Floats, Finding]]:
    """Index, Schur complement and finding of candidates that act and have physically possible coefficients.

    `weights` [blocks]. The Schur complement is that of the power; coefficients and evidence are those of power and
    logged torques together, two independent witnesses of the same parameters, and of the priors.
    """
    rows = float((design.blocks.rows * (weights > 0)).sum())
    for number, (candidate, own) in enumerate(zip(candidates, contest.owns, strict=True)):
        schur, products = part_of(competition.schur, competition.products, own, candidate)
        if not _acts(schur):
            continue
        at_joints = design.at_joints(candidate, weights)
        both = schur if at_joints is None else schur + at_joints.precision
        projected = products if at_joints is None else products + at_joints.product
        both = both + np.diag(_precision(candidate))
        coefficients = solve_part(both, projected)
        if not _possible(candidate, coefficients, both):
            continue
        drop = float(projected @ coefficients)
        evidence = drop - (candidate.size + candidate.cost) * np.log(rows) - 2 * np.log(candidate.tried)
        joints = 0.0 if at_joints is None else at_joints.gain(coefficients)
        yield number, schur, Finding(candidate, coefficients, drop, float(evidence), joints)


def _precision(candidate: Candidate) -> Floats:
    """[k] of the normal priors: a far-fetched size costs what it gains (maximum a posteriori)."""
    return np.zeros(candidate.size) if candidate.variant is None else candidate.variant.precision


def _acts(schur: Floats) -> bool:
    """False for columns that never act under the gate, or that the regression explains already."""
    return bool(schur.size and np.diag(schur).min() >= THRESHOLDS.least_column_power)


def _possible(candidate: Candidate, coefficients: Floats, schur: Floats) -> bool:
    """Whether all parameters lie within their physical bounds, or at most two standard errors outside."""
    if candidate.variant is None:
        return True
    parameters = candidate.variant.place.parameters
    if all(np.isinf(parameter.low) and np.isinf(parameter.high) for parameter in parameters):
        return True
    slack = THRESHOLDS.bounds_slack * np.sqrt(np.maximum(np.diag(np.linalg.pinv(schur)), 0.0))
    low, high = (np.array([getattr(parameter, side) for parameter in parameters]) for side in ("low", "high"))
    return bool(np.all((coefficients >= low - slack) & (coefficients <= high + slack)))


def _consistency(design: Design, gate: Floats, candidate: Candidate, agreement: Floats) -> tuple[int, float]:
    """Number of recordings in which the candidate acts, and the share of them that agree with the pooled estimate."""
    names = np.array([part.recording for part in design.parts])
    block_power = np.zeros(len(gate))
    for block in np.flatnonzero(gate):
        block_power[block] = design.blocks.plain.squares(int(block), candidate.places).sum()
    recordings = [(names == name) & (gate > 0) for name in np.unique(names[gate > 0])]
    power = np.array([block_power[blocks].sum() for blocks in recordings])
    direction = np.array([agreement[blocks].sum() for blocks in recordings])
    acting = power > THRESHOLDS.active_share * power.max()
    if not acting.any():  # only in rows that are left out
        return 0, 0.0
    return int(acting.sum()), float((direction[acting] > 0).mean())


def _surprise(E: Floats, schur: Floats) -> float:
    """-log p of the score test with the blocks' own covariance; E [blocks, k] are their scores."""
    V = E.T @ E + THRESHOLDS.score_ridge * schur
    statistic, rank = quadratic_form(V, E.sum(axis=0))
    return float(-chi2.logsf(float(statistic), rank))


def _held_out(
    design: Design, regression: Regression, gate: Floats, contest: _Contest, candidates: list[Candidate]
) -> Floats:
    """[3, candidates, recordings] gain of a recording by coefficients from the others.

    White with random intercepts, in W, and in W about the mean of every block.
    """
    names = [part.recording for part in design.parts]
    recordings = sorted({name for name, open_ in zip(names, gate, strict=True) if open_})
    white, plain = design.blocks.white, design.blocks.plain
    one = design.columns.model.layout.place("standby").start
    intercepts = next((column.deviation for column in regression.columns if column.block_intercept), np.inf)
    grams = (UnknownLevel(white, one, intercepts**-2.0), plain, UnknownLevel(plain, one))
    gains = np.zeros((len(grams), len(candidates), len(recordings)))
    for number, recording in enumerate(recordings):
        out = np.array([part.in_question and part.recording == recording for part in design.parts])
        competition = regression.compete(contest.used, gate, (~out).astype(float))
        sides = [
            regression.held_out_products(competition, contest.used, gate, np.flatnonzero(out), gram) for gram in grams
        ]
        for k, (candidate, own) in enumerate(zip(candidates, contest.owns, strict=True)):
            schur, products = part_of(competition.schur, competition.products, own, candidate)
            if not _acts(schur):
                continue
            coefficients = solve_part(schur, products)
            for side, (Q, s) in enumerate(sides):
                Qk, sk = part_of(Q, s, own, candidate)
                gains[side, k, number] = 2 * coefficients @ sk - coefficients @ Qk @ coefficients
    return gains
