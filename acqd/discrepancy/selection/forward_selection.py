"""Forward selection: the effect that explains most, then again with that effect, until no effect is credible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from acqd.discrepancy.regression.gram import Regression
from acqd.discrepancy.regression.setup import Setup
from acqd.discrepancy.selection.accepted import Tracing
from acqd.discrepancy.selection.doubt import clear_doubts, doubted_steps, without_doubted
from acqd.discrepancy.selection.family import likeliest_member
from acqd.discrepancy.selection.nuisance import with_small_differences, without_large_level
from acqd.discrepancy.selection.ranking import rank_pooled
from acqd.discrepancy.selection.stepwise import Step
from acqd.discrepancy.selection.supply_response import with_loaded_laws
from acqd.discrepancy.thresholds import THRESHOLDS


@dataclass(frozen=True, slots=True)
class Limits:
    """What the user asked for."""

    max_effects: int = 5
    seed: int = 1


def trace(setup: Setup, limits: Limits, progress: Callable[[str], None]) -> Tracing:
    """Select effects one after the other."""
    regression = base = with_small_differences(setup)
    tracing = Tracing(setup.design, setup.regression, setup.design.witness)
    while len(tracing.effects) < limits.max_effects and doubted_steps(tracing) <= THRESHOLDS.doubted_steps:
        progress(f"looking for effect {len(tracing.effects) + 1}")
        named = Step(tracing, regression, setup.gates, limits.seed).run()
        if named is None:
            break
        tracing.effects.append(named)
        regression = _with_effects(tracing, base)
        base = without_large_level(base, regression, tracing.design)
        regression = tracing.regression = _with_effects(tracing, base)
        clear_doubts(tracing)
    if without_doubted(tracing):
        regression = _with_effects(tracing, base)
    tracing.regression = regression.on(tracing.design.blocks)
    before = len(tracing.effects)
    _prune(tracing)
    if len(tracing.effects) < before:
        tracing.regression = _with_effects(tracing, base)
    _prefer_likeliest(tracing, base, limits.seed)
    accepted = {(named.id, named.finding.candidate.label) for named in tracing.effects}
    tracing.hypotheses = [each for each in tracing.hypotheses if (each.id, each.where) not in accepted]
    if tracing.effects:
        tracing.verdict = "effects_found"
    elif tracing.unknown is not None:
        tracing.verdict = "unknown_structure"
    return tracing


def _prefer_likeliest(tracing: Tracing, base: Regression, seed: int) -> None:
    """Give every family the name of the member that most recordings prefer."""
    for number, named in enumerate(list(tracing.effects)):
        likeliest = likeliest_member(tracing, named, seed)
        if likeliest is not named:
            tracing.effects[number] = likeliest
            tracing.regression = _with_effects(tracing, base)


def _with_effects(tracing: Tracing, base: Regression) -> Regression:
    """The base model with the selected effects, and common laws that act on the power of these."""
    tracing.design, common = with_loaded_laws(tracing.design, base.on(tracing.design.blocks), tracing.effects)
    columns = [column for each in tracing.effects for column in each.columns()]
    return common.with_columns(tracing.design.blocks, columns)


def _prune(tracing: Tracing) -> None:
    """Remove effects that later ones made superfluous."""
    for named in list(tracing.effects):
        if len(tracing.effects) < 2:
            return
        without = tracing.regression.without(named.key)
        design = replace(tracing.design, witness=named.witness)
        again = rank_pooled(design, without, named.gate.open, [named.finding.candidate])
        if not again or again[0].evidence < THRESHOLDS.least_evidence:
            tracing.effects = [other for other in tracing.effects if other.key != named.key]
            tracing.regression = without
