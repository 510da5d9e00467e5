"""Forward selection: the effect with the largest evidence, then again beside that effect, until none passes its margin.

Names and laws are two explanations of the same residual. A law that explains more than the leading effect by its
margin is a doubt, not a verdict: a curve may explain a friction and a load together. The names continue, and in the
end the whole list of names is compared with the law in their place, every hypothesis paying its margin (ADR 26).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from acqd.discrepancy.regression.least_squares import Column
from acqd.discrepancy.regression.setup import Setup
from acqd.discrepancy.selection.accepted import Hypothesis, Selected, Selection, Unknown
from acqd.discrepancy.selection.agreement import disagreements
from acqd.discrepancy.selection.judging import USUAL, kinds_of, margin
from acqd.discrepancy.selection.placing import placed, selected, without
from acqd.discrepancy.selection.ranking import Rows, ranked
from acqd.discrepancy.selection.session_columns import with_sessions
from acqd.discrepancy.selection.spread import logs_in_question, variance_of_sessions
from acqd.discrepancy.selection.step import State, Step, led_by, taken
from acqd.discrepancy.selection.supply_response import with_loaded_laws


@dataclass(frozen=True, slots=True)
class Limits:
    """What the user asked for."""

    max_effects: int = 5


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """A law that explains more than the effect that was selected instead."""

    before: State
    """The state that the law could have continued."""
    rows: Rows
    """With the columns of the step's detections."""
    law: Unknown
    table: tuple[Hypothesis, ...]


def select(setup: Setup, limits: Limits, progress: Callable[[str], None]) -> Selection:
    """Select effects one after the other, and compare the list with the first law that outdid one of them."""
    rows = with_sessions(setup)
    state = State(rows, rows, tuple(setup.gates), kinds_of(setup.design.columns.candidates))
    state, doubt = _grown(state, limits, progress)
    state = _settled(state)
    if doubt is not None and _remains(state, limits) and _by_law(doubt, limits) > _explained(state):
        table = led_by(doubt.table, doubt.law.finding)
        state = replace(doubt.before, rows=doubt.rows, unknown=doubt.law, table=table, standing=state.standing)
    rows = replace(state.rows, regression=state.rows.regression.on(state.rows.design.blocks))
    return Selection(
        rows=rows, witness=setup.design.witness, effects=state.effects, unknown=state.unknown, steps=state.steps,
        table=state.table, usual=state.usual, standing=state.standing,
    )  # fmt: skip


def _grown(state: State, limits: Limits, progress: Callable[[str], None]) -> tuple[State, Doubt | None]:
    """With effects until no effect leads that passes, and the first doubt on the way."""
    doubt: Doubt | None = None
    while len(state.effects) < limits.max_effects:
        progress(f"looking for effect {len(state.effects) + 1}")
        step = Step.of(state)
        if step is None:
            break
        state = replace(state, standing=state.standing or step.standing())
        varied = _with_varied(state, 0.0 if step.leader is None else step.leader.finding.evidence)
        if varied is not None:
            state = varied
            continue
        if step.usual is not None:
            state = _with_usual(state, step)
            continue
        if step.leader is None:
            unknown = None if step.law is None else step.unknown
            table = step.table if unknown is None else led_by(step.table, unknown.finding)
            state = replace(state, rows=step.rows, unknown=unknown, table=table)
            break
        if step.outdone and doubt is None:
            doubt = Doubt(state, step.rows, step.unknown, step.table)
        rows, effect = step.accepted()
        state = replace(state, rows=rows, steps=(*state.steps, step.table))
        state = _with_effects(state, (*state.effects, effect))
    while (varied := _with_varied(state, 0.0)) is not None:  # of the last effect that the user asked for
        state = varied
    return state, doubt


def _with_effects(state: State, effects: tuple[Selected, ...]) -> State:
    """The base model with effects, and common laws that act on the power of these."""
    base = replace(state.base, design=state.rows.design, regression=state.base.regression.on(state.rows.design.blocks))
    design, common = with_loaded_laws(base.design, base.regression, effects)
    keys = {each.key for each in effects}
    varied = tuple(column for column in state.varied if column.varies in {*keys, USUAL})
    columns = [*(column for each in effects for column in each.columns()), *varied]
    rows = replace(state.rows, design=design, regression=common.with_columns(design.blocks, columns))
    return replace(state, rows=rows, effects=effects, varied=varied)


def _with_usual(state: State, step: Step) -> State:
    """With random effects of every log in question, of the size that unchanged sessions differ by (ADR 82).

    A clock that drifts in every session explains much and says nothing: effects are judged beside that.
    """
    assert step.usual is not None
    finding = step.usual.finding
    design = step.rows.design
    regression = state.rows.regression.on(design.blocks)
    weights = np.abs(finding.candidate.weights(finding.coefficients))
    columns = []
    for gate in logs_in_question(design).values():
        variance, _ = variance_of_sessions(design, regression, finding, gate)
        pairs = zip(finding.candidate.indices.tolist(), (weights * np.sqrt(variance)).tolist(), strict=True)
        columns += [Column(index, gate, deviation, varies=USUAL) for index, deviation in pairs if deviation > 0]
    rows = replace(state.rows, design=design, regression=regression.with_columns(design.blocks, columns))
    return replace(
        state, rows=rows, varied=(*state.varied, *columns), usual=(*state.usual, step.usual),
        steps=(*state.steps, step.table),
    )  # fmt: skip


def _with_varied(state: State, beyond: float) -> State | None:
    """With columns of the logs that ask for other parameters of an effect, by more evidence than `beyond`.

    The difference between logs is a hypothesis like any other: the largest evidence leads. None where nothing is added.
    """
    known = {column.varies for column in state.varied}
    asked = [each for each in state.effects if each.key not in known]
    found = {each.key: disagreements(state.rows, each) for each in asked}
    evidence, key = max(((max(logs.values(), default=0.0), key) for key, (logs, _) in found.items()), default=(0.0, ""))
    if evidence <= beyond:
        return None
    logs, columns = found[key]
    clearest = tuple(sorted(logs, key=lambda log: -logs[log]))
    effects = tuple(replace(each, disagreeing=clearest) if each.key == key else each for each in state.effects)
    regression = state.rows.regression.with_columns(state.rows.design.blocks, columns)
    rows = replace(state.rows, regression=regression)
    return replace(state, rows=rows, effects=effects, varied=(*state.varied, *columns))


def _remains(state: State, limits: Limits) -> bool:
    """Whether a law explains more, beside all names, than what wrong columns leave.

    Before a payload has its name, a curve of friction explains a part of it. Where the search ended with the most
    effects, nobody has looked.
    """
    return state.unknown is not None or len(state.effects) >= limits.max_effects


def _by_law(doubt: Doubt, limits: Limits) -> float:
    """Evidence above the margins of the effects before a law, of the law, and of the effect that leads beside it."""
    state, law = doubt.before, doubt.law
    net = _explained(state) + law.finding.evidence - law.margin
    if len(state.effects) + 1 >= limits.max_effects:
        return net
    columns = [Column(int(index), law.gate.open, owner="law") for index in law.finding.candidate.indices]
    rows = replace(doubt.rows, regression=doubt.rows.regression.with_columns(doubt.rows.design.blocks, columns))
    step = Step.of(replace(state, rows=rows, law=law))
    return net if step is None or step.leader is None else net + step.leader.finding.evidence - step.leader.margin


def _explained(state: State) -> float:
    """Evidence above the margins of all selected effects, one beside the other.

    What became superfluous had taken a part of the evidence that the others now have.
    """
    rows, known, net = state.rows, [each.finding for each in state.usual], 0.0
    for each in state.effects:
        rows = replace(rows, regression=rows.regression.without(each.key))
    for each in state.effects:
        alone = without(rows, each)
        for found in ranked(alone, each.gate.open, [each.finding.candidate]):
            net += found.evidence - margin(alone, each.gate.open, found, known, state.kinds)
            known.append(found)
        rows = replace(rows, regression=rows.regression.with_columns(rows.design.blocks, each.columns()))
    return net


def _settled(state: State) -> State:
    """Beside all others: without effects that later ones made superfluous, the others at the fewest places (ADR 26).

    Before a payload has its name, the friction of every joint explains a part of it. An effect that another one leads
    by now gives its place to that one: the order in which effects were selected decides nothing.
    """
    for each in state.effects:
        others = tuple(other for other in state.effects if other.key != each.key)
        if not others:
            break
        rows, gate = without(state.rows, each), each.gate.open
        again = ranked(rows, gate, [each.finding.candidate])
        if not again or again[0].evidence <= margin(rows, gate, again[0], [], state.kinds):
            state = _with_effects(state, others)
            continue
        pool = [c for c in rows.design.columns.candidates if c.id and not taken(c, others)]
        best = next(iter(ranked(rows, gate, pool)), again[0])
        ahead = best.candidate.id != each.id and best.evidence > again[0].evidence
        exchanged = _exchanged(state, each, again[0].evidence) if ahead else None
        if exchanged is not None:
            state = exchanged
            continue
        same = ranked(rows, gate, [c for c in rows.design.columns.candidates if c.id == each.id])
        fit = None if not same else placed(rows, gate, same[0], same, state.kinds, None)
        if fit is not None and fit.finding.candidate.label != each.finding.candidate.label:
            state = replace(state, rows=replace(state.rows, design=fit.rows.design))
            moved = selected(fit, each.gate, each.hypothesis, each.table, each.witness)
            moved = replace(moved, disagreeing=each.disagreeing)
            state = _with_effects(state, tuple(moved if other.key == each.key else other for other in state.effects))
    return state


def _exchanged(state: State, each: Selected, evidence: float) -> State | None:
    """With another effect that leads in the place of `each` and has more evidence; None without one."""
    step = Step.of(_with_effects(state, tuple(other for other in state.effects if other.key != each.key)))
    if step is None or step.leader is None or step.leader.id == each.id or step.leader.finding.evidence <= evidence:
        return None
    rows, leader = step.accepted()
    state = replace(state, rows=rows, steps=(*state.steps, step.table))
    return _with_effects(state, tuple(leader if other.key == each.key else other for other in state.effects))
