"""Which effects the recordings can tell apart, and from which size on.

With every other column projected out, an effect of size theta has the expected evidence E = s theta^2. Another effect
explains the share rho^2 of it, the squared canonical correlation of the columns. The loop says one name only where
that is ahead by margin = 2 log(kinds / pi) + kappa^2 E (`judging`), so that u = theta sqrt(s (1 - rho^2)) satisfies

    u^2 (1 - kappa^2 / (1 - rho^2)) - 2 q u >= 2 log(kinds / pi)

with q = 1.645 for a probability of 95 %: the difference of two evidences scatters by 2 u (Vuong 1989). Where
1 - rho^2 <= kappa^2, no number of minutes of this motion suffices: the two effects are a family (ADR 48).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from acqd.arrays import Floats
from acqd.discrepancy.ability.smallest import POWER, Smallest, competition_of
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import LEAST_POWER, Competition
from acqd.discrepancy.selection.judging import kinds_of
from acqd.discrepancy.selection.ranking import Rows, acts, part_of, prior_of
from acqd.discrepancy.selection.spread import AS_IT_IS, More
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """Another effect that could explain an effect's power."""

    id: str
    where: str
    """The place that explains most."""
    explains: float
    """Share of the effect's evidence that the rival explains, 0 to 1."""
    size: float | None
    """Of the effect, from which the two are told apart; None: from no size on, they are a family."""


def rivals_of(
    rows: Rows, gate: Floats, effects: list[Smallest], longer: float = 1.0, more: More = AS_IT_IS
) -> list[tuple[Rival, ...]]:
    """Per effect its rivals, one for each other effect of the library, the closest first."""
    candidates = [each for each in rows.design.columns.candidates if each.id]
    if not effects:
        return []
    used, competition = competition_of(rows, gate, candidates, longer, more)
    explained = _explained(rows, used, competition, effects, candidates)
    kinds = kinds_of(rows.design.columns.candidates)
    witness = rows.design.witness
    seen = {each.id for each in candidates if witness is not None and witness.sees(each.id)}
    return [
        _closest(effect, candidates, shares, seen, kinds) for effect, shares in zip(effects, explained.T, strict=True)
    ]


def _closest(
    effect: Smallest, candidates: list[Candidate], shares: Floats, seen: set[str], kinds: int
) -> tuple[Rival, ...]:
    """The best candidate of every other effect; `shares` [candidates] of the effect's power.

    `seen`: effects that logged torques show. They show how much of a torque there is, and not whose: another one of
    these effects may explain all of it.
    """
    order = np.argsort(-shares)
    best: dict[str, Rival] = {}
    for number in order.tolist():
        candidate = candidates[number]
        if candidate.id != effect.candidate.id and candidate.id not in best:
            of_power = (1 - effect.from_torques) * float(shares[number])
            share = of_power + effect.from_torques * (candidate.id in seen)
            best[candidate.id] = Rival(candidate.id, candidate.label, share, _told_apart(effect, share, kinds))
    return tuple(sorted(best.values(), key=lambda rival: -rival.explains))


def _explained(
    rows: Rows, used: Indices, competition: Competition, effects: list[Smallest], candidates: list[Candidate]
) -> Floats:
    """[candidates, effects] share of an effect's squared power that a candidate explains, all else projected out."""
    weights = np.zeros((len(used), len(effects)))
    for number, effect in enumerate(effects):
        weights[np.searchsorted(used, effect.candidate.indices), number] = effect.candidate.weights(np.ones(1))
    cross = competition.schur @ weights
    power = np.maximum(np.einsum("ck,ck->k", weights, cross), LEAST_POWER)
    explained = np.zeros((len(candidates), len(effects)))
    for number, candidate in enumerate(candidates):
        positions = np.searchsorted(used, candidate.indices)
        schur, _ = part_of(competition.schur, competition.products, positions, candidate)
        if not acts(schur):
            continue
        whole = schur + np.diag(prior_of(rows.design, candidate) ** -2.0 / rows.learning_rate)
        theirs = cross[positions] if candidate.mix is None else candidate.mix.T @ cross[positions]
        explained[number] = np.einsum("pk,pk->k", theirs, np.linalg.solve(whole, theirs)) / power
    return np.clip(explained, 0.0, 1.0)


def _told_apart(effect: Smallest, explained: float, kinds: int) -> float | None:
    """The size from which a rival that explains a share of the effect is told apart; at least the smallest size."""
    left = 1 - explained
    if effect.size is None or left <= THRESHOLDS.column_error**2:
        return None
    share, q = 1 - THRESHOLDS.column_error**2 / left, float(ndtri(POWER))
    u = (q + np.sqrt(q**2 + share * by_chance(kinds))) / share
    return max(effect.size, float(u / np.sqrt(effect.precision * left)))
