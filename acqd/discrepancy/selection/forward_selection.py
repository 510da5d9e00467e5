"""Forward selection: the effect with the largest evidence, then again beside that effect, until none passes its margin.

Names and laws are two explanations of the same residual. A law that explains more than the leading effect by its
margin is a doubt, not a verdict: a curve may explain a friction and a load together. The names continue, and in the
end the whole list of names is compared with the law in their place, every hypothesis paying its margin (ADR 26).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.gram import Column
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.regression.setup import Setup
from acqd.discrepancy.selection.accepted import Hypothesis, Selected, Selection, Unknown, unnamed
from acqd.discrepancy.selection.detectors.candidates import Detection, detect
from acqd.discrepancy.selection.judging import best_of_each, judged, kinds_of, margin, white_power
from acqd.discrepancy.selection.ranking import Finding, Rows, ranked
from acqd.discrepancy.selection.session_columns import with_sessions
from acqd.discrepancy.selection.shape_fit import ShapeFit, fit_shape
from acqd.discrepancy.selection.standing import Contender, Standing
from acqd.discrepancy.selection.supply_response import with_loaded_laws
from acqd.models.effects import library

_TABLE = 6
"""Hypotheses that are judged and shown."""
_FITTED = 3
"""Effects whose shapes are fitted before they are compared."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What the user asked for."""

    max_effects: int = 5


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """What a search stands on."""

    rows: Rows
    base: Rows
    """Without the selected effects; its regression only."""
    gates: tuple[Gate, ...]
    kinds: int
    effects: tuple[Selected, ...] = ()
    law: Unknown | None = None
    """A law in the place of names."""
    doubts: tuple[_Doubt, ...] = ()
    unknown: Unknown | None = None
    table: tuple[Hypothesis, ...] = ()
    standing: Standing | None = None
    """Of the first step."""

    @property
    def known(self) -> list[Finding]:
        """Findings that a later one is judged beside."""
        return [each.finding for each in self.effects] + ([self.law.finding] if self.law is not None else [])


@dataclass(frozen=True, slots=True, eq=False)
class _Doubt:
    """A law that explains more than the effect that was selected instead."""

    before: _State
    """The state that the law could have continued."""
    rows: Rows
    """With the columns of the step's detections."""
    law: Unknown
    passes: bool
    """Whether the law by itself shows that something is there; else only the name is in doubt."""
    table: tuple[Hypothesis, ...]


def select(setup: Setup, limits: Limits, progress: Callable[[str], None]) -> Selection:
    """Select effects one after the other, and compare the list with laws that outdid one of them."""
    rows = with_sessions(setup)
    state = _State(rows, rows, tuple(setup.gates), kinds_of(setup.design.columns.candidates))
    state, withdrawn = _settled(_grown(state, limits, progress)), ""
    for doubt in state.doubts[:1]:
        number = len(doubt.before.effects)
        names = sum(each.net for each in state.effects[number:])
        if _explained_by_law(doubt, limits) > names:
            unknown = doubt.law if doubt.passes else None
            withdrawn = "" if doubt.passes else unnamed(doubt.law.finding.candidate.label)
            state = replace(doubt.before, rows=doubt.rows, unknown=unknown, table=doubt.table, standing=state.standing)
    rows = replace(state.rows, regression=state.rows.regression.on(state.rows.design.blocks))
    return Selection(rows, setup.design.witness, state.effects, state.unknown, state.table, withdrawn, state.standing)


def _grown(state: _State, limits: Limits, progress: Callable[[str], None]) -> _State:
    """With effects until no effect leads that passes."""
    while len(state.effects) < limits.max_effects:
        progress(f"looking for effect {len(state.effects) + 1}")
        step = _Step.of(state)
        if step is None:
            return state
        state = replace(state, standing=state.standing or step.standing())
        if step.leader is None:
            unknown = step.unknown if step.law is not None and step.law.passes else None
            return replace(state, rows=step.rows, unknown=unknown, table=step.table)
        doubts = state.doubts
        if step.outdone:
            assert step.law is not None
            doubts = (*doubts, _Doubt(state, step.rows, step.unknown, step.law.passes, step.table))
        state = replace(_with(state, step.accepted()), doubts=doubts)
    return state


def _with(state: _State, accepted: tuple[Rows, Selected]) -> _State:
    """With one more effect."""
    rows, selected = accepted
    return _with_effects(replace(state, rows=rows), (*state.effects, selected))


def _with_effects(state: _State, effects: tuple[Selected, ...]) -> _State:
    """The base model with effects, and common laws that act on the power of these."""
    base = replace(state.base, design=state.rows.design, regression=state.base.regression.on(state.rows.design.blocks))
    design, common = with_loaded_laws(base.design, base.regression, effects)
    columns = [column for each in effects for column in each.columns()]
    regression = common.with_columns(design.blocks, columns)
    return replace(state, rows=replace(state.rows, design=design, regression=regression), effects=effects)


def _explained_by_law(doubt: _Doubt, limits: Limits) -> float:
    """Evidence above the margins of a law and of the one effect that leads beside the law, if one passes."""
    state, law = doubt.before, doubt.law
    net = law.finding.evidence - law.margin
    if len(state.effects) + 1 >= limits.max_effects:
        return net
    columns = [Column(int(index), law.gate.open, owner="law") for index in law.finding.candidate.indices]
    rows = replace(doubt.rows, regression=doubt.rows.regression.with_columns(doubt.rows.design.blocks, columns))
    step = _Step.of(replace(state, rows=rows, law=law))
    return net if step is None or step.leader is None else net + step.leader.finding.evidence - step.leader.margin


def _settled(state: _State) -> _State:
    """Beside all others: without effects that later ones made superfluous, the others at the fewest places (ADR 26).

    Before a payload has its name, the friction of every joint explains a part of it.
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
        same = ranked(rows, gate, [c for c in rows.design.columns.candidates if c.id == each.id])
        fit = None if not same else _fitted(rows, gate, same[0], same, state.kinds, None)
        if fit is not None and fit.finding.candidate.label != each.finding.candidate.label:
            state = replace(state, rows=replace(state.rows, design=fit.rows.design))
            moved = _selected(fit, each.gate, each.hypothesis, each.table, each.witness)
            state = _with_effects(state, tuple(moved if other.key == each.key else other for other in state.effects))
    return state


def _selected(
    fit: ShapeFit, gate: Gate, row: Hypothesis, table: tuple[Hypothesis, ...], witness: Witness | None
) -> Selected:
    """An effect at the place and in the shape of its fit."""
    candidate = fit.finding.candidate
    assert candidate.variant is not None
    shape = fit.shape | library()[candidate.id].fixed_shape(fit.rows.design.columns.scenes)
    place = (candidate.fitted or candidate.variant).place
    return Selected(fit.finding, gate, place, shape, replace(row, finding=fit.finding, status="named"), witness, table)


def _fitted(
    rows: Rows, gate: Floats, best: Finding, ranking: list[Finding], kinds: int, detection: Detection | None
) -> ShapeFit:
    """An effect at the fewest places that the data asks for, with a fitted shape.

    More places have to explain more by the margin: they also mop up what the columns of few places get wrong.
    """
    claims: dict[int, Finding] = {}
    for finding in ranking:
        if finding.candidate.id == best.candidate.id and finding.candidate.size <= best.candidate.size:
            claims.setdefault(finding.candidate.size, finding)
    few, *more = (claims[size] for size in sorted(claims)) if claims else [best]
    fit = fit_shape(rows, gate, few, detection)
    for claim in more:
        if claim.evidence <= few.evidence + margin(rows, gate, claim, [few], kinds):
            continue
        larger = fit_shape(rows, gate, claim, detection)
        known = replace(few, evidence=fit.finding.evidence)
        if larger.finding.evidence > fit.finding.evidence + margin(rows, gate, claim, [known], kinds):
            few, fit = claim, larger
    return fit


def without(rows: Rows, selected: Selected) -> Rows:
    """Rows in which a selected effect competes again."""
    design = replace(rows.design, witness=selected.witness)
    return Rows(design, rows.regression.without(selected.key).on(design.blocks), rows.learning_rate)


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """One step: the table of hypotheses under the likeliest onset."""

    state: _State
    rows: Rows
    """With the columns of detections and fitted shapes."""
    gate: Gate
    table: tuple[Hypothesis, ...]
    fits: dict[str, ShapeFit]
    """By id of the effect."""
    detections: dict[str, Detection]
    leader: Hypothesis | None
    """The effect to select."""
    law: Hypothesis | None
    """The unnamed alternative that explains most, if that is more than chance."""
    outdone: bool
    """Whether the law explains more than the leader by the margin."""
    best: tuple[Finding, ...]
    """Of every kind, the largest evidence first."""
    beyond: float
    """Evidence of the best hypothesis, at most what unchanged sessions leave of it."""

    @classmethod
    def of(cls, state: _State) -> _Step | None:
        """None where no candidate acts."""
        rows, detections, detected = _with_detections(state)
        pool = [c for c in rows.design.columns.candidates if not _taken(c, state.effects)]
        gate, findings = _likeliest(rows, state, pool)
        findings += ranked(rows, state.gates[0].open, detected)
        if not findings:
            return None
        best = best_of_each(findings)
        fits: dict[str, ShapeFit] = {}
        scanned = {each.candidate.id: each for each in best if each.candidate.id}
        count = min(_FITTED, len(scanned))
        while len(fits) < count or ((leading := _first_name(best)) is not None and leading.candidate.id not in fits):
            finding = next(each for each in best if each.candidate.id and each.candidate.id not in fits)
            name = finding.candidate.id
            own = state.gates[0] if finding.candidate.detected else gate
            fits[name] = _fitted(rows, own.open, finding, findings, state.kinds, detections.get(finding.candidate.key))
            best = [fits[name].finding if each.candidate.id == name else each for each in best]
            best.sort(key=lambda each: -each.evidence)
        return cls._judged(state, rows, gate, best, fits, scanned, detections)

    @classmethod
    def _judged(
        cls, state: _State, rows: Rows, gate: Gate, best: list[Finding], fits: dict[str, ShapeFit],
        scanned: dict[str, Finding], detections: dict[str, Detection],
    ) -> _Step:  # fmt: skip
        def judge(finding: Finding, more: list[Finding]) -> Hypothesis:
            fit = fits.get(finding.candidate.id)
            where = state.gates[0] if finding.candidate.detected else gate
            detection = detections.get(finding.candidate.key)
            seen = rows if fit is None else fit.rows
            return judged(
                seen,
                where.open,
                finding,
                [*state.known, *more],
                state.kinds,
                scanned.get(finding.candidate.id),
                detection,
            )

        shown = [each for each in best[:_TABLE] if each.evidence > 0]
        first = _first_name(best)
        leader = None if first is None else judge(first, [])
        law = next((judge(each, []) for each in best if not each.candidate.id), None)
        beyond = max(min(each.finding.evidence, each.beyond_sessions) for each in (leader, law) if each is not None)
        law = None if law is None or law.finding.evidence <= law.margin else law
        outdone = False
        if law is not None and leader is not None and first is not None:
            fit = fits[first.candidate.id]
            least = margin(fit.rows, gate.open, law.finding, [*state.known, first], state.kinds)
            outdone = law.finding.evidence > first.evidence + least
        table = tuple(_row(each, judge(each, []), first) for each in shown)
        if leader is not None and leader.missing:
            leader = None
        return cls(state, rows, gate, table, fits, detections, leader, law, outdone, tuple(best), beyond)

    def standing(self) -> Standing:
        """Of every kind of hypothesis; of the laws, the best."""
        law = next((each for each in self.best if not each.candidate.id), None)
        kinds = [*(each for each in self.best if each.candidate.id), *([] if law is None else [law])]
        return Standing.of([self._contender(each) for each in kinds], self.beyond)

    def _contender(self, finding: Finding) -> Contender:
        """With the power in every block in question, zero before an onset.

        Of what was searched for in the residual, the evidence above what the same search gains in the reference counts.
        """
        fit = self.fits.get(finding.candidate.id)
        design = (self.rows if fit is None else fit.rows).design
        everywhere = self.state.gates[0].open
        power = white_power(design, finding, everywhere)
        if not finding.candidate.detected:
            counts = [part.own.stop - part.own.start for part in design.parts]
            power = power * np.repeat(self.gate.open, np.array(counts) * (everywhere > 0))
        twin = finding.candidate.twin
        other = None if twin is None else (twin.id, twin.probability)
        detection = self.detections.get(finding.candidate.key)
        usual = 0.0 if detection is None or detection.refinable else self.rows.learning_rate * detection.in_reference()
        return Contender(finding.candidate.id, finding.evidence - max(usual, 0.0), power, other)

    @property
    def unknown(self) -> Unknown:
        """The law in the place of a name."""
        assert self.law is not None
        return Unknown(self.law.finding, self.gate, self.law.margin)

    def accepted(self) -> tuple[Rows, Selected]:
        """Rows with columns that belong to the leader's parameters, and the effect."""
        assert self.leader is not None
        fit = self.fits[self.leader.id]
        candidate = fit.finding.candidate
        before, rows = fit.rows.design.witness, fit.rows
        if before is not None and candidate.fitted is not None and before.sees(candidate.id):
            rows = rows.on(replace(rows.design, witness=before.given(candidate.id, candidate.fitted)))
        gate = self.state.gates[0] if library()[candidate.id].detected else self.gate
        return rows, _selected(fit, gate, self.leader, self.table, before)


def _first_name(best: list[Finding]) -> Finding | None:
    """The effect with the largest evidence."""
    return next((each for each in best if each.candidate.id), None)


def _row(finding: Finding, alone: Hypothesis, leader: Finding | None) -> Hypothesis:
    """A row of the table, with what the hypothesis lacks against the leader."""
    if finding is leader:
        return replace(alone, status="refused" if alone.missing else "named")
    if leader is None or alone.missing:
        return alone
    short = leader.evidence - finding.evidence
    lacks = f"{short:.0f} more evidence than {leader.candidate.id}" if short > 0 else f"a name: {leader.candidate.id}"
    return replace(alone, missing=(lacks,))


def _taken(candidate: Candidate, effects: tuple[Selected, ...]) -> bool:
    """Whether a selected effect has some of the candidate's columns already."""
    if not candidate.id or candidate.variant is None:
        return False
    mine = set(candidate.variant.place.columns)
    return any(each.id == candidate.id and mine & set(each.place.columns) for each in effects)


def _with_detections(state: _State) -> tuple[Rows, dict[str, Detection], list[Candidate]]:
    """Rows with the columns of effects that the residual suggests, and their candidates."""
    rows, detections, candidates = state.rows, {}, []
    known = {each.id for each in state.effects}
    for number, detection in enumerate(detect(rows.design, rows.regression, state.gates[0].open, known)):
        design, indices = rows.design.with_columns(detection.columns)
        rows = rows.on(design)
        key = f"{detection.name} detected {len(known)}.{number}"
        candidate = detection.candidate(indices, key, design.columns.model)
        detections[candidate.key] = detection
        candidates.append(candidate)
    return rows, detections, candidates


def _likeliest(rows: Rows, state: _State, pool: list[Candidate]) -> tuple[Gate, list[Finding]]:
    """No onset, unless an onset explains more by the margin."""
    gate, findings = state.gates[0], ranked(rows, state.gates[0].open, pool)
    best, known = findings[0] if findings else None, list(state.known)
    for other in state.gates[1:]:
        found = ranked(rows, other.open, pool)
        ahead = found and (best is None or found[0].evidence > best.evidence)
        if ahead and findings and gate is state.gates[0]:
            least = margin(rows, other.open, found[0], [*known, findings[0]], state.kinds * len(state.gates))
            ahead = found[0].evidence > findings[0].evidence + least
        if ahead:
            gate, findings, best = other, found, found[0]
    return gate, findings
