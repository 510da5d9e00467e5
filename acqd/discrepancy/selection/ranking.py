"""Which candidate explains most of what is left, and whether that can be chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Candidate, Design
from acqd.discrepancy.regression.gram import Model
from acqd.numerics import solve_scaled_ridge

_DRAWS = 999
_ACTIVE_SHARE = 0.01  # of the power that it has in the recording where it has most
_MIN_COLUMN_POWER = 1e-3  # white sum of squares of a column that never acts, or that the model has already


@dataclass(frozen=True, slots=True)
class Finding:
    """One candidate under one gate."""

    candidate: Candidate
    coefficients: Floats
    drop: float
    """White sum of squares that it takes away."""
    evidence: float
    """The drop, less what so many free numbers take away by chance: k log n."""
    gains: Floats
    """[recordings] drop on each recording where it acts, by coefficients from the others."""
    plain: float
    """The same gains together, of the error as it is, not whitened [W^2 rows]."""
    plain_error: float
    """Standard error of that, as recordings differ."""
    acting: int
    """Recordings in which it acts."""
    consistency: float
    """Share of the recordings, among those where it acts, that say the same as all together."""
    surprise: float
    """-log of the probability that a candidate alone is so consistent by chance; the maximum is calibrated apart."""

    @property
    def held_out(self) -> float:
        """Drop on recordings that did not take part."""
        return float(self.gains.sum())


Places: TypeAlias = NDArray[np.int64]


def _columns(candidates: list[Candidate]) -> tuple[Places, list[Places]]:
    used = np.unique(np.concatenate([candidate.places for candidate in candidates]))
    return used, [np.searchsorted(used, candidate.places) for candidate in candidates]


def solve_part(S: Floats, r: Floats) -> Floats:
    """Coefficients of candidates that compete with each other only."""
    return solve_scaled_ridge(S, r, 1e-8)


def _part(S: Floats, r: Floats, own: Places, candidate: Candidate) -> tuple[Floats, Floats]:
    S, r = S[np.ix_(own, own)], r[own]
    if candidate.mix is not None:
        S, r = candidate.mix.T @ S @ candidate.mix, candidate.mix.T @ r
    return S, r


def rank(design: Design, model: Model, gate: Floats, candidates: list[Candidate]) -> list[Finding]:
    """All candidates under a gate, the one with most evidence first."""
    used, owns = _columns(candidates)
    found = model.compete(used, gate)
    scores = model.scores(found, used, gate)
    gains, plain = held_out(design, model, gate, used, owns, candidates)
    rows = float((design.blocks.rows * gate).sum())
    findings = []
    for number, (candidate, own) in enumerate(zip(candidates, owns, strict=True)):
        S, r = _part(found.S, found.r, own, candidate)
        if not S.size or np.diag(S).min() < _MIN_COLUMN_POWER:
            continue  # never acts here, or the model has it already
        theta = solve_part(S, r)
        if not _possible(candidate, theta, S):
            continue
        drop = float(r @ theta)
        E = scores[:, own] if candidate.mix is None else scores[:, own] @ candidate.mix
        findings.append(
            Finding(
                candidate,
                theta,
                drop,
                drop - (candidate.size + candidate.cost) * np.log(rows),
                gains[number],
                float(plain[number].sum()),
                float(plain[number].std() * np.sqrt(len(plain[number]))),
                *_consistency(design, gate, candidate, E @ theta),
                _surprise(E, S),
            )
        )
    return sorted(findings, key=lambda finding: -finding.evidence)


def rank_pooled(
    design: Design, model: Model, gate: Floats, candidates: list[Candidate], weights: Floats | None = None
) -> list[Finding]:
    """The same without a look at single recordings; `weights` [blocks] as in Model.compete."""
    used, owns = _columns(candidates)
    found = model.compete(used, gate, weights)
    rows = float((design.blocks.rows * gate).sum())
    findings = []
    for candidate, own in zip(candidates, owns, strict=True):
        S, r = _part(found.S, found.r, own, candidate)
        if not S.size or np.diag(S).min() < _MIN_COLUMN_POWER:
            continue
        theta = solve_part(S, r)
        if not _possible(candidate, theta, S):
            continue
        drop = float(r @ theta)
        evidence = drop - (candidate.size + candidate.cost) * np.log(rows)
        findings.append(Finding(candidate, theta, drop, evidence, np.empty(0), 0.0, 0.0, 0, 0.0, 0.0))
    return sorted(findings, key=lambda finding: -finding.evidence)


def _possible(candidate: Candidate, theta: Floats, S: Floats) -> bool:
    """Whether a lone parameter lies within its physical bounds, or not clearly outside."""
    if candidate.variant is None or candidate.size > 1:
        return True
    parameter = candidate.variant.place.parameters[0]
    slack = 2.0 / np.sqrt(S[0, 0])
    return bool(parameter.low - slack <= theta[0] <= parameter.high + slack)


def _consistency(design: Design, gate: Floats, candidate: Candidate, agreement: Floats) -> tuple[int, float]:
    """In how many recordings it acts, and the share of them that pull in the direction of all together."""
    names = np.array([part.recording for part in design.parts])
    own = design.blocks.plain[:, candidate.places, candidate.places].sum(axis=1)
    recordings = [(names == name) & (gate > 0) for name in np.unique(names[gate > 0])]
    power = np.array([own[blocks].sum() for blocks in recordings])
    pulls = np.array([agreement[blocks].sum() for blocks in recordings])
    acting = power > _ACTIVE_SHARE * power.max()
    if not acting.any():  # only in rows that are left out
        return 0, 0.0
    return int(acting.sum()), float((pulls[acting] > 0).mean())


def _surprise(E: Floats, S: Floats) -> float:
    V = E.T @ E + 1e-3 * S
    u = E.sum(axis=0)
    return float(-chi2.logsf(u @ np.linalg.solve(V, u), len(u)))


def chance(model: Model, gate: Floats, candidates: list[Candidate], seed: int) -> Floats:
    """[draws] the largest surprise of any candidate when the signs of whole blocks are random (wild bootstrap)."""
    used, owns = _columns(candidates)
    found = model.compete(used, gate)
    scores = model.scores(found, used, gate)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(_DRAWS, len(scores)))
    largest = np.zeros(_DRAWS)
    for candidate, own in zip(candidates, owns, strict=True):
        S, _ = _part(found.S, found.r, own, candidate)
        if not S.size or np.diag(S).min() < _MIN_COLUMN_POWER:
            continue
        E = scores[:, own] if candidate.mix is None else scores[:, own] @ candidate.mix
        V = E.T @ E + 1e-3 * S
        u = signs @ E
        statistic = np.einsum("dk,dk->d", u, np.linalg.solve(V, u.T).T)
        largest = np.maximum(largest, -chi2.logsf(statistic, E.shape[1]))
    return largest


def held_out(
    design: Design, model: Model, gate: Floats, used: Places, owns: list[Places], candidates: list[Candidate]
) -> tuple[list[Floats], list[Floats]]:
    """Per candidate, the drop in each recording under the gate with coefficients from all others: white, and plain."""
    names = [part.recording for part in design.parts]
    recordings = sorted({name for name, open_ in zip(names, gate, strict=True) if open_})
    gains = np.zeros((2, len(candidates), len(recordings)))
    for number, recording in enumerate(recordings):
        own_blocks = np.array([name == recording for name in names])
        found = model.compete(used, gate, (~own_blocks).astype(float))
        sides = [
            model.held_out_products(found, used, gate, np.flatnonzero(own_blocks), grams)
            for grams in (design.blocks.grams, design.blocks.plain)
        ]
        for k, (candidate, own) in enumerate(zip(candidates, owns, strict=True)):
            S, r = _part(found.S, found.r, own, candidate)
            if not S.size or np.diag(S).min() < _MIN_COLUMN_POWER:
                continue
            theta = solve_part(S, r)
            for side, (Q, s) in enumerate(sides):
                Qk, sk = _part(Q, s, own, candidate)
                gains[side, k, number] = 2 * theta @ sk - theta @ Qk @ theta
    return list(gains[0]), list(gains[1])
