"""One step of the search: what competes beside the selected effects, who leads, and which law explains more."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.least_squares import Column
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection.accepted import Hypothesis, Selected, Unknown, unnamed
from acqd.discrepancy.selection.detectors.candidates import Detection, detect
from acqd.discrepancy.selection.judging import USUAL, best_of_each, judged, margin, refines, taken_by_shape, white_power
from acqd.discrepancy.selection.placing import placed, selected
from acqd.discrepancy.selection.ranking import Finding, Rows, ranked
from acqd.discrepancy.selection.shape_fit import ShapeFit
from acqd.discrepancy.selection.standing import Contender, Standing, proportional
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library

_TABLE = 6
"""Hypotheses that are judged and shown."""
_FITTED = 3
"""Effects whose shapes are fitted before they are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """What a search stands on."""

    rows: Rows
    base: Rows
    """Without the selected effects; its regression only."""
    gates: tuple[Gate, ...]
    kinds: int
    effects: tuple[Selected, ...] = ()
    varied: tuple[Column, ...] = ()
    """Of logs that ask for other parameters of an effect."""
    law: Unknown | None = None
    """A law in the place of names."""
    usual: tuple[Hypothesis, ...] = ()
    """What unchanged sessions differ by, too: random effects of the logs in question."""
    unknown: Unknown | None = None
    steps: tuple[tuple[Hypothesis, ...], ...] = ()
    """Tables of the steps before."""
    table: tuple[Hypothesis, ...] = ()
    """Of the step that ended the search."""
    standing: Standing | None = None
    """Of the first step."""

    @property
    def known(self) -> list[Finding]:
        """Findings that a later one is judged beside."""
        law = [] if self.law is None else [self.law.finding]
        return [*(each.finding for each in self.effects), *(each.finding for each in self.usual), *law]


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step: the table of hypotheses under the likeliest onset."""

    state: State
    rows: Rows
    """With the columns of detections and fitted shapes."""
    gate: Gate
    table: tuple[Hypothesis, ...]
    fits: dict[str, ShapeFit]
    """By id of the effect."""
    detections: dict[str, Detection]
    leader: Hypothesis | None
    """The effect to select."""
    usual: Hypothesis | None
    """What would lead if unchanged sessions did not differ by as much; with columns over both sides."""
    law: Hypothesis | None
    """The unnamed alternative that explains most, if that passes by itself."""
    outdone: bool
    """Whether the law explains more than the leader by the margin."""
    best: tuple[Finding, ...]
    """Of every kind, the largest evidence first."""
    beyond: float
    """Evidence of the best hypothesis, at most what unchanged sessions leave of it."""

    @classmethod
    def of(cls, state: State) -> Step | None:
        """None where no candidate acts."""
        rows, detections, detected = _with_detections(state)
        usual = {each.id or each.where for each in state.usual}
        free = [c for c in rows.design.columns.candidates if (c.id or c.label) not in usual]
        pool = [c for c in free if not taken(c, state.effects)]
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
            fits[name] = placed(rows, own.open, finding, findings, state.kinds, detections.get(finding.candidate.key))
            best = [fits[name].finding if each.candidate.id == name else each for each in best]
            best.sort(key=lambda each: -each.evidence)
        return cls._judged(state, rows, gate, best, fits, scanned, detections)

    @classmethod
    def _judged(
        cls, state: State, rows: Rows, gate: Gate, best: list[Finding], fits: dict[str, ShapeFit],
        scanned: dict[str, Finding], detections: dict[str, Detection],
    ) -> Step:  # fmt: skip
        def judge(finding: Finding) -> Hypothesis:
            fit, where = fits.get(finding.candidate.id), state.gates[0] if finding.candidate.detected else gate
            return judged(
                rows if fit is None else fit.rows, where.open, finding, state.known, state.kinds,
                scanned.get(finding.candidate.id), detections.get(finding.candidate.key),
            )  # fmt: skip

        shown = [each for each in best[:_TABLE] if each.evidence > 0]
        first = _simplest(best, fits, gate)
        leader = None if first is None else judge(first)
        law = next((judge(each) for each in best if not each.candidate.id), None)
        beyond = max(min(each.finding.evidence, each.beyond_sessions) for each in (leader, law) if each is not None)
        law = None if law is None or law.finding.evidence <= law.margin else law
        outdone = False
        if law is not None and first is not None:
            fit = fits[first.candidate.id]
            least = margin(fit.rows, gate.open, law.finding, [*state.known, first], state.kinds)
            outdone = law.finding.evidence > first.evidence + least
        blocked = leader is None or bool(leader.missing)
        usual = None
        if law is not None and law.missing == (USUAL,) and (outdone or blocked):
            usual = law
        elif leader is not None and leader.missing == (USUAL,):
            usual = replace(leader, finding=scanned.get(leader.id, leader.finding))
        law = None if law is None or law.missing else law
        return cls(
            state, rows, gate, led_by(tuple(map(judge, shown)), first), fits, detections, None if blocked else leader,
            usual, law, outdone and law is not None, tuple(best), beyond,
        )  # fmt: skip

    def standing(self) -> Standing:
        """Of every kind of hypothesis; of the laws, the best."""
        law = next((each for each in self.best if not each.candidate.id), None)
        kinds = [*(each for each in self.best if each.candidate.id), *([] if law is None else [law])]
        return Standing.of([self._contender(each) for each in kinds], self.beyond)

    def _contender(self, finding: Finding) -> Contender:
        """With the power in every block in question, zero before an onset."""
        fit = self.fits.get(finding.candidate.id)
        design = (self.rows if fit is None else fit.rows).design
        everywhere = self.state.gates[0].open
        power = white_power(design, finding, everywhere)
        if not finding.candidate.detected:
            counts = [part.own.stop - part.own.start for part in design.parts]
            power = power * np.repeat(self.gate.open, np.array(counts) * (everywhere > 0))
        twin = finding.candidate.twin
        other = None if twin is None else (twin.id, twin.probability)
        return Contender(finding.candidate.id, finding.evidence, power, other)

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
        return rows, selected(fit, gate, self.leader, self.table, before)


def _first_name(best: list[Finding]) -> Finding | None:
    """The effect with the largest evidence."""
    return next((each for each in best if each.candidate.id), None)


def _simplest(best: list[Finding], fits: dict[str, ShapeFit], gate: Gate) -> Finding | None:
    """The effect that leads: without a free shape where wrong columns explain what the shape adds (ADR 105)."""
    first = _first_name(best)
    if first is None:
        return None
    others = [fit.finding for fit in fits.values() if refines(first.candidate, fit.finding.candidate)]
    for other in others:
        powers = [white_power(fits[each.candidate.id].rows.design, each, gate.open) for each in (first, other)]
        left = THRESHOLDS.column_error**2 * proportional(*powers) * first.evidence
        if first.evidence - other.evidence <= taken_by_shape(left):
            return other
    return first


def led_by(table: tuple[Hypothesis, ...], leader: Finding | None) -> tuple[Hypothesis, ...]:
    """The table, with what every hypothesis that passes by itself lacks against the one that leads."""

    def row(each: Hypothesis) -> Hypothesis:
        if each.finding is leader:
            return each if each.status == "refused" else replace(each, status="leads", missing=())
        if leader is None or each.status == "refused":
            return each
        return replace(each, status="candidate", missing=(_lacks(each.finding, leader),))

    return tuple(map(row, table))


def _lacks(finding: Finding, leader: Finding) -> str:
    """What a hypothesis that passes by itself lacks to lead."""
    ahead, short = leader.candidate.id or unnamed(leader.candidate.label), leader.evidence - finding.evidence
    if short > 0:
        return f"{short:.0f} more evidence than {ahead}"
    if not finding.candidate.id:
        return f"a name: {ahead}"
    if refines(finding.candidate, leader.candidate):
        return f"more evidence than wrong columns of {ahead} leave"
    return "the largest evidence of all effects"  # the effect that has it fails, and a law stands in its place


def taken(candidate: Candidate, effects: tuple[Selected, ...]) -> bool:
    """Whether a selected effect has some of the candidate's columns already."""
    if not candidate.id or candidate.variant is None:
        return False
    mine = set(candidate.variant.place.columns)
    return any(each.id == candidate.id and mine & set(each.place.columns) for each in effects)


def _with_detections(state: State) -> tuple[Rows, dict[str, Detection], list[Candidate]]:
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


def _likeliest(rows: Rows, state: State, pool: list[Candidate]) -> tuple[Gate, list[Finding]]:
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
