"""One step of forward selection: the likeliest onset, the best credible effect under it, its shape."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Regression
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection.acceptance import View, credible, equal_to, leading, refuted, serious, worth
from acqd.discrepancy.selection.accepted import Named, Tracing, Unknown
from acqd.discrepancy.selection.detectors.candidates import Detection, detect
from acqd.discrepancy.selection.hypotheses import hypotheses
from acqd.discrepancy.selection.masking import transient, without_rows_of
from acqd.discrepancy.selection.ranking import Finding, chance, rank, rank_pooled
from acqd.discrepancy.selection.shape_fit import fit_shape
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library


@dataclass(frozen=True, slots=True)
class _Winner:
    """The best credible finding under a gate."""

    finding: Finding
    gate: Gate
    alternatives: list[Finding]
    doubt: Unknown | None = None


class Step:
    """The search for one more effect, with those that `tracing` already holds."""

    def __init__(self, tracing: Tracing, regression: Regression, gates: list[Gate], seed: int) -> None:
        self._tracing, self._gates, self._seed = tracing, gates, seed
        self._regression = regression
        taken = {(named.id, named.finding.candidate.label) for named in tracing.effects}
        candidates = tracing.design.columns.candidates
        self._pool = [c for c in candidates if (c.id, c.label) not in taken or not c.id]
        self._detections: dict[str, Detection] = {}
        self._detected: list[Candidate] = []

    def run(self) -> Named | None:
        """Under the likeliest onset; if nothing is credible there, without an onset.

        If nothing is credible at all, retry with the rows of transient effects masked out.
        """
        tracing = self._tracing
        self._detect()
        everywhere = self._view(tracing.design, self._regression, tracing.effects, complete=True)
        likeliest = self._likeliest_gate(everywhere)
        winner = self._best_under_gate(likeliest, everywhere)
        unknown = tracing.unknown
        if winner is None and likeliest is not self._gates[0]:
            winner = _without_doubt(self._best_under_gate(self._gates[0], everywhere))
            tracing.unknown = unknown  # a second look may name an effect, but raises no doubts
        if winner is not None:
            return self._accept(winner)
        transients = [named for named in tracing.effects if transient(tracing.design, named.finding, named.gate.open)]
        if not transients:
            return None
        masked = without_rows_of(tracing.design, [named.finding for named in transients])
        masked_keys = {named.key for named in transients}
        rest = [named for named in tracing.effects if named.key not in masked_keys]
        calm = self._view(masked, Regression(masked.blocks, self._regression.columns), rest, complete=False)
        self._detected = []
        winner = _without_doubt(self._best_under_gate(self._likeliest_gate(calm), calm))
        tracing.unknown = unknown
        return None if winner is None else self._accept(winner)

    def _detect(self) -> None:
        """Add the columns of effects that the residual suggests."""
        tracing = self._tracing
        known = {named.id for named in tracing.effects}
        for number, detection in enumerate(detect(tracing.design, self._regression, self._gates[0].open, known)):
            tracing.design, places = tracing.design.with_columns(detection.columns)
            candidate = detection.candidate(places, f"{detection.name} detected {len(known)}.{number}")
            self._detections[candidate.key] = detection
            self._detected.append(candidate)
        self._regression = self._regression.on(tracing.design.blocks)

    def _view(self, design: Design, regression: Regression, prior: list[Named], *, complete: bool) -> View:
        return View(design, regression, list(prior), self._detections, complete)

    def _likeliest_gate(self, view: View) -> Gate:
        """No onset, unless an onset explains clearly more."""
        best = [rank_pooled(view.design, view.regression, gate.open, self._pool)[:1] for gate in self._gates]
        evidence = np.array([found[0].evidence if found else -np.inf for found in best])
        top = int(evidence.argmax())
        enough = THRESHOLDS.onset_factor * evidence[0] + THRESHOLDS.onset_margin
        return self._gates[top] if evidence[top] > enough else self._gates[0]

    def _best_under_gate(self, gate: Gate, view: View) -> _Winner | None:
        tracing = self._tracing
        findings = rank(view.design, view.regression, gate.open, self._pool)
        if self._detected:
            findings += rank(view.design, view.regression, self._gates[0].open, self._detected)
        findings.sort(key=lambda finding: -worth(finding))
        tracing.last_ranking = findings
        limit = self._chance_limit(gate, view)
        named = [finding for finding in findings if finding.candidate.id]
        unnamed = [finding for finding in findings if not finding.candidate.id]
        tracing.hypotheses = hypotheses(view, findings, limit)
        best = leading(view, named, limit)
        by_evidence = sorted(unnamed, key=lambda finding: -finding.evidence)
        alternative = next((finding for finding in by_evidence if credible(view, finding, limit)), None)
        doubt = None
        if alternative is not None and (best is None or refuted(view, gate, best, alternative)):
            doubt = Unknown(alternative, gate)
            equal = equal_to(view, gate, alternative, named)
            if equal is not None:
                best, doubt = equal, None
            elif best is None or best.candidate.detected:
                tracing.unknown = tracing.unknown or doubt
                return None
        if best is None or (best.candidate.detected and _outdone_by_any(best, unnamed)):
            return None
        others = _best_of_each([finding for finding in named if serious(view.design, finding)], best)
        doubts = [each for each in by_evidence if serious(view.design, each)]
        alternatives = others[: THRESHOLDS.contenders] + doubts[: THRESHOLDS.unnamed_contenders]
        return _Winner(best, gate, alternatives, doubt)

    def _chance_limit(self, gate: Gate, view: View) -> float:
        """Surprise that clean recordings exceed with the probability `chance`; more for the best of several onsets."""
        surprises = chance(view.regression, gate.open, self._pool, self._seed)
        limit = float(np.quantile(surprises, 1 - THRESHOLDS.chance))
        return limit if gate is self._gates[0] else limit + float(np.log(len(self._gates)))

    def _accept(self, winner: _Winner) -> Named:
        """With columns that belong to the effect's parameters, over all rows."""
        tracing = self._tracing
        tracing.unknown = None
        candidate = winner.finding.candidate
        gate = self._gates[0] if candidate.detected else winner.gate
        detection = self._detections.get(candidate.key)
        claims = [winner.finding, *_at_fewer_places(winner.finding, tracing.last_ranking)]
        fits = [fit_shape(tracing.design, self._regression, gate.open, each, detection) for each in claims]
        fitted = max(fits, key=lambda each: each.finding.evidence)
        before = tracing.design.witness
        found = fitted.finding.candidate
        if before is not None and found.fitted is not None and before.sees(found.id):
            tracing.design = replace(fitted.design, witness=before.given(found.id, found.fitted))
        else:
            tracing.design = fitted.design
        assert found.variant is not None
        place = (found.fitted or found.variant).place
        shape = fitted.shape | library()[candidate.id].fixed_shape(tracing.design.columns.scenes)
        return Named(
            fitted.finding, gate, place, shape, winner.alternatives, before, winner.doubt, tracing.last_ranking,
            tracing.hypotheses,
        )  # fmt: skip


def _without_doubt(winner: _Winner | None) -> _Winner | None:
    """None for a winner that an unnamed alternative outdoes."""
    return None if winner is None or winner.doubt is not None else winner


def _outdone_by_any(detected: Finding, unnamed: list[Finding]) -> bool:
    """Whether an unnamed alternative, credible or not, explains more than something that was found by searching."""
    return any(finding.evidence > detected.evidence for finding in unnamed)


def _at_fewer_places(finding: Finding, ranking: list[Finding]) -> list[Finding]:
    """The best finding of the same effect with fewer parameters: others mop up the error of a scanned shape."""
    candidate = finding.candidate
    if not library()[candidate.id].bounds:
        return []
    fewer = [each for each in ranking if each.candidate.id == candidate.id and each.candidate.size < candidate.size]
    return [max(fewer, key=lambda each: each.evidence)] if fewer else []


def _best_of_each(named: list[Finding], best: Finding) -> list[Finding]:
    """The first finding of every effect but the best one."""
    seen, others = {best.candidate.id}, []
    for finding in named:
        if finding.candidate.id not in seen:
            seen.add(finding.candidate.id)
            others.append(finding)
    return others
