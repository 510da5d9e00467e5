"""An effect at the fewest places, and in the shape, that the data asks for; and rows in which it competes again."""

from __future__ import annotations

from dataclasses import replace

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection.accepted import Hypothesis, Selected
from acqd.discrepancy.selection.detectors.candidates import Detection
from acqd.discrepancy.selection.judging import margin
from acqd.discrepancy.selection.ranking import Finding, Rows
from acqd.discrepancy.selection.shape_fit import ShapeFit, fit_shape
from acqd.models.effects import library


def placed(
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


def selected(
    fit: ShapeFit, gate: Gate, row: Hypothesis, table: tuple[Hypothesis, ...], witness: Witness | None
) -> Selected:
    """An effect at the place and in the shape of its fit."""
    candidate = fit.finding.candidate
    assert candidate.variant is not None
    shape = fit.shape | library()[candidate.id].fixed_shape(fit.rows.design.columns.scenes)
    place = (candidate.fitted or candidate.variant).place
    return Selected(fit.finding, gate, place, shape, replace(row, finding=fit.finding, status="leads"), witness, table)


def without(rows: Rows, effect: Selected) -> Rows:
    """Rows in which a selected effect competes again."""
    design = replace(rows.design, witness=effect.witness)
    return Rows(design, rows.regression.without(effect.key).on(design.blocks), rows.learning_rate)
