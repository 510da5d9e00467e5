"""How sure a name is: the probability that the effect explains more than each of its rivals, and its family.

The evidence of two hypotheses differs by a sum over recordings; its error follows from their spread (the test of
non-nested models of Vuong 1989). Columns that are wrong by a share kappa add what they could move from one to the
other. Nothing is drawn at random. Rivals that the leader does not exceed by the margin, or that alone deny it the least
confidence, are its family: the data cannot tell them apart (ADR 26). Otherwise a name would be said beside a rival that
is as good, and not beside one that is a little worse.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acqd import student
from acqd.arrays import Floats
from acqd.discrepancy.regression.least_squares import Column
from acqd.discrepancy.selection.accepted import Selected, Selection, Unknown, unnamed
from acqd.discrepancy.selection.judging import (
    best_of_each,
    kinds_of,
    left_by,
    margin,
    possible,
    refines,
    taken_by_shape,
)
from acqd.discrepancy.selection.placing import placed, without
from acqd.discrepancy.selection.ranking import Finding, Rows, gains, ranked
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance

_EFFECTS, _LAWS = 6, 3
"""Rivals that are compared."""
_FITTED = 2
"""Rivals whose shapes are fitted."""
_SHOWN = 3


@dataclass(frozen=True, slots=True)
class Confidence:
    """Probabilities of a name and of its rivals."""

    share: float
    """That the effect explains more than every rival."""
    rivals: tuple[tuple[str, float], ...]
    """Ids of effects, or laws in words, with their probabilities; the likeliest first."""
    family: tuple[tuple[str, str], ...]
    """Ids and places of effects that cannot be told from this one."""
    family_share: float
    """Together with the family."""
    doubt: Unknown | None
    """A law that is likelier than the family."""
    agreeing: float
    """Share of recordings that the effect explains better than no effect."""
    possible: bool
    """Whether physics permits the sizes."""


def confidence(selection: Selection, selected: Selected) -> Confidence:
    """Given all other selected effects, which are part of the explanation and no rivals."""
    rows, gate = without(selection.rows, selected), selected.gate.open
    rows, own, rivals = _contenders(selection, rows, selected)
    _, gained = gains(rows, gate, [own, *rivals])
    kinds = kinds_of(selection.design.columns.candidates)
    odds = np.array([_odds(rows, selected, own, rival, gained[[0, k]], kinds) for k, rival in enumerate(rivals, 1)])
    names = np.array([rival.candidate.id for rival in rivals])
    share = _share(odds, names)
    shares = odds * share
    near = [
        rival.candidate for k, rival in enumerate(rivals)
        if rival.candidate.id and (
            own.evidence - rival.evidence < margin(rows, gate, rival, [own], kinds)
            or _share(odds[[k]], names[[k]]) < THRESHOLDS.least_confidence
        )
    ]  # fmt: skip
    ids = {candidate.id for candidate in near}
    strangers = ~np.isin(names, sorted(ids))
    together = _share(odds[strangers], names[strangers])
    laws = [(s, rival) for rival, s in zip(rivals, shares, strict=True) if not rival.candidate.id and s > together]
    doubt = max(laws, key=lambda pair: pair[0], default=None)
    pairs = [*zip([_name(r) for r in rivals], shares.tolist(), strict=True)]
    family = [(c.id, c.label) for c in near]
    twin = selected.finding.candidate.twin
    if twin is not None and twin.id not in _taken_by(selection):  # the power is the same: only the times speak
        pairs = [(twin.id, share * twin.probability), *pairs]
        family = [(twin.id, twin.where), *family]
        share *= 1 - twin.probability
    listed = sorted(pairs, key=lambda pair: -pair[1])
    return Confidence(
        share=share, rivals=tuple(listed[:_SHOWN]), family=tuple(family),
        family_share=together,
        doubt=None if doubt is None else Unknown(doubt[1], selected.gate, selected.hypothesis.margin),
        agreeing=float((gained[0] > 0).mean()), possible=possible(rows, gate, own, [], kinds),
    )  # fmt: skip


def _taken_by(selection: Selection) -> set[str]:
    """Ids of the selected effects."""
    return {other.id for other in selection.effects}


def _share(odds: Floats, names: NDArray[np.str_]) -> float:
    """Probability against rivals by their odds; `names`: ids of effects, "" for laws.

    Rivals resemble each other: the best effect and the best law stand for all of their kind.
    """
    return float(
        (1 - THRESHOLDS.chance) / (1 + odds[names != ""].max(initial=0.0) + odds[names == ""].max(initial=0.0))
    )


def _contenders(selection: Selection, rows: Rows, selected: Selected) -> tuple[Rows, Finding, list[Finding]]:
    """The effect and its rivals on the same rows; the best of these in a fitted shape at the fewest places, too."""
    taken, gate = _taken_by(selection), selected.gate.open
    detected = [each.finding.candidate for each in selected.table if each.finding.candidate.detected]
    pool = [c for c in (*selection.design.columns.candidates, *detected) if c.id not in taken and c.id != selected.id]
    findings, kinds = ranked(rows, gate, pool), kinds_of(selection.design.columns.candidates)
    best = best_of_each(findings)
    effects = [each for each in best if each.candidate.id][:_EFFECTS]
    fitted = []
    for rival in effects[:_FITTED]:
        if not rival.candidate.detected:
            fit = placed(rows, gate, rival, findings, kinds, None)
            rows = fit.rows
            fitted.append(fit.finding)
        else:
            fitted.append(rival)
    laws = [each for each in best if not each.candidate.id][:_LAWS]
    own = ranked(rows, gate, [selected.finding.candidate])
    return rows, own[0] if own else selected.finding, [*fitted, *effects[_FITTED:], *laws]


def _odds(rows: Rows, selected: Selected, own: Finding, rival: Finding, gained: Floats, kinds: int) -> float:
    """Probability that the rival is right in the place of the effect, over that of the opposite.

    A law may act beside the effect, and is never selected there: the effect is wrong if it explains less than the law,
    and nothing beside it.
    """
    odds = _explains_more(rows, selected, own, rival, gained, kinds)
    if rival.candidate.id or odds <= THRESHOLDS.chance:
        return odds
    return min(odds, _superfluous_beside(rows, selected, own, rival, gained[0], kinds))


def _explains_more(rows: Rows, selected: Selected, own: Finding, rival: Finding, gained: Floats, kinds: int) -> float:
    """Probability that the rival explains more than the effect, over that of the opposite.

    A law has to explain more by the margin: names are preferred, and a curve takes what wrong columns leave. What these
    could move from one to the other is a 95 % limit, of which a free shape takes its part (ADR 105). What the
    description of the base model contributes to the evidence is no recording's: the sum of gains may be zero.
    """
    of_columns = THRESHOLDS.column_error**2 * left_by(rows.design, selected.gate.open, rival, [own])
    ahead = own.evidence - rival.evidence
    if not rival.candidate.id:
        ahead += by_chance(kinds) + of_columns
    if refines(rival.candidate, own.candidate):
        ahead += taken_by_shape(of_columns)
    if refines(own.candidate, rival.candidate):
        ahead -= taken_by_shape(of_columns)
    return _against(
        ahead,
        float(np.hypot(_error(gained[0] - gained[1], gained[0]), of_columns / THRESHOLDS.interval_width)),
        gained.shape[1],
    )


def _superfluous_beside(
    rows: Rows, selected: Selected, own: Finding, law: Finding, gained: Floats, kinds: int
) -> float:
    """Probability that the effect explains nothing beside a law, over that of the opposite.

    `gained` [recordings] without the law. What wrong columns of the law leave counts as chance does.
    """
    gate = selected.gate.open
    columns = [Column(int(index), gate, owner="law") for index in law.candidate.indices]
    beside = replace(rows, regression=rows.regression.with_columns(rows.design.blocks, columns))
    again = ranked(beside, gate, [own.candidate])
    if not again:
        return np.inf
    ahead = again[0].evidence - margin(rows, gate, own, [law], kinds)
    _, rest = gains(beside, gate, again)
    return _against(ahead, _error(rest[0], gained), len(gained))


def _error(differences: Floats, gained: Floats) -> float:
    """Standard error of a sum over recordings [n], of which some say more: those that gain more by the effect.

    The spread is that about a line through zero (the regression estimator of Cochran 1977).
    """
    count = len(differences)
    scatter = differences - gained * float(gained @ differences) / max(float(gained @ gained), 1e-12)
    return float(np.sqrt(scatter @ scatter * count / max(count - 1, 1)))


def _against(ahead: float, error: float, recordings: int) -> float:
    """Odds against a difference of evidence above zero, with Student's degrees of freedom."""
    wins = float(student.cdf(ahead / max(error, 1.0), recordings - 1 + THRESHOLDS.few_sessions))
    return (1 - wins) / max(wins, 1e-9)


def _name(finding: Finding) -> str:
    return finding.candidate.id or unnamed(finding.candidate.label)
