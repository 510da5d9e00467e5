"""Doubts about a selected effect: an unnamed alternative explains more, perhaps because it explains two causes at once.

A flexible function of a speed explains a friction and a constant load together, and neither name explains as much
alone. So an effect in doubt is selected for the time being, and compared again with every effect that follows. This is
the encompassing test of Mizon and Richard (1986), with the other effects as part of both models. But three frictions of
one joint imitate any curve: the effects together must also explain clearly more than the alternative alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Places, Regression
from acqd.discrepancy.selection.acceptance import outdone
from acqd.discrepancy.selection.accepted import Named, Tracing
from acqd.discrepancy.selection.ranking import rank_pooled, solve_part
from acqd.discrepancy.thresholds import THRESHOLDS


def clear_doubts(tracing: Tracing) -> None:
    """Clear the doubts that the other selected effects explain."""
    tracing.effects = [
        each if each.doubt is None or _outdone(tracing, each) or _imitates(tracing, each) else replace(each, doubt=None)
        for each in tracing.effects
    ]


def doubted_steps(tracing: Tracing) -> int:
    """Number of effects that were selected since the first one in doubt, and this one."""
    doubted = [number for number, each in enumerate(tracing.effects) if each.doubt is not None]
    return len(tracing.effects) - doubted[0] if doubted else 0


def without_doubted(tracing: Tracing) -> bool:
    """Whether an effect is still in doubt: it is dropped with all that follow, and its alternative is the finding."""
    steps = doubted_steps(tracing)
    if not steps:
        return False
    first = tracing.effects[-steps]
    tracing.unknown, tracing.last_ranking, tracing.hypotheses = first.doubt, first.ranking, first.hypotheses
    tracing.effects = tracing.effects[:-steps]
    return True


def _outdone(tracing: Tracing, named: Named) -> bool:
    """Whether the unnamed alternative still explains clearly more, given all other selected effects."""
    assert named.doubt is not None
    others = [other for other in tracing.effects if other.key != named.key]
    design = replace(tracing.design, witness=named.witness)
    rivals = [named.finding.candidate, named.doubt.finding.candidate]
    found = rank_pooled(design, tracing.regression.without(named.key), named.gate.open, rivals)
    evidence = {finding.candidate.key: finding for finding in found}
    own, alternative = (evidence.get(candidate.key) for candidate in rivals)
    return own is None or (alternative is not None and outdone(own, alternative, others))


def _imitates(tracing: Tracing, named: Named) -> bool:
    """Whether the effect and those that followed explain together not clearly more than the alternative alone."""
    assert named.doubt is not None
    keys = [each.key for each in tracing.effects]
    together = tracing.effects[keys.index(named.key) :]
    if len(together) == 1:
        return False
    regression = tracing.regression
    for each in together:
        regression = regression.without(each.key)
    places = np.concatenate([each.finding.candidate.places for each in together])
    gate = named.gate.open
    explained = _evidence(tracing.design, regression, gate, places)
    alone = _evidence(tracing.design, regression, gate, named.doubt.finding.candidate.places)
    return explained <= alone + THRESHOLDS.alternative_margin + THRESHOLDS.alternative_share * explained


def _evidence(design: Design, regression: Regression, gate: Floats, places: Places) -> float:
    """Of free coefficients of some columns, by the power."""
    competition = regression.compete(places, gate)
    drop = float(competition.products @ solve_part(competition.schur, competition.products))
    return drop - len(places) * float(np.log(max(float(design.blocks.rows @ gate), 2.0)))
