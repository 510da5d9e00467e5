"""The result of the loop for machines (report.json), and its sentences."""

from __future__ import annotations

from typing import Any

import numpy as np

from acqd.discrepancy.ability.ability import smallest_in_words
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.repair.terms import Reported, described
from acqd.discrepancy.report import causes
from acqd.discrepancy.report.cost import cost_of
from acqd.discrepancy.report.main_parameter import changed_place
from acqd.discrepancy.report.wander import wandering
from acqd.discrepancy.selection.accepted import unnamed
from acqd.discrepancy.settled import SURE
from acqd.discrepancy.thresholds import OF_THE_LOOP, THRESHOLDS
from acqd.models.effects import library, unmoved
from acqd.models.yearly import Duty
from acqd.threshold import described as thresholds_of

VERDICTS = {
    "effects_found": "An effect that the model lacks was found.",
    "nothing_left": "The error of the model shows no credible effect.",
    "unknown_structure": "The error of the model has a structure that no effect of the library explains.",
    "not_identifiable": "The error of the model has a structure, but these recordings cannot identify its cause.",
}
_SHOWN_CONFIDENCE = 0.02
"""Alternatives with less confidence are not worth an experiment."""


def as_json(config: CloseConfig, closed: Closed) -> dict[str, Any]:
    """report.json: documented keys first."""
    subject = closed.subject
    return {
        "target": "P",
        "unit": "W",
        "measured": subject.data.measured,
        "recordings": {
            "fit": len({segment.recording for segment in subject.fit}),
            "held_out": len({segment.recording for segment in subject.held_out}),
        },
        "noise_floor": closed.floor_W,
        "before": closed.before.as_json(),
        "after": closed.after.as_json(),
        "verdict": closed.verdict,
        "effects": [_effect(closed, each, config.duty) for each in closed.named],
        "causes": causes.as_json(closed),
        "correction": None if closed.correction is None else closed.correction.as_json(),
        "unexplained": unexplained(closed),
        "question": subject.question,
        "noise_floor_from": closed.floor_source,
        "reference_rmse": closed.reference_rmse,
        "joint_level": None if closed.joints is None else closed.joints.as_text(),
        "joints": [] if closed.joints is None else closed.joints.as_json(),
        "hypotheses": [each.as_json() for each in closed.hypotheses],
        "steps": [[each.as_json() for each in table] for table in closed.selection.tables],
        "ability": closed.ability.as_json(),
        "next": next_steps(closed),
        "designable": _designable(closed),
        "joint_names": subject.robot.joint_names,
        "notes": closed.notes,
        "warnings": closed.warnings,
        "model": {"name": subject.bundle.metadata["name"], "bundle": str(config.bundle)},
        "dataset": str(config.dataset),
        "seed": config.seed,
        "asked": config.as_json(),
        "thresholds": thresholds_of(OF_THE_LOOP, closed.stages),
    }


def _effect(closed: Closed, each: Reported, duty: Duty) -> dict[str, Any]:
    cost = cost_of(closed, each, duty)
    after = closed.after.rmse
    before = after + each.gain_W
    lowest = min(closed.after.rmse, closed.reference_rmse or np.inf)
    explainable = max(closed.before.rmse**2 - lowest**2, 1e-12)
    return {
        "id": each.term.id,
        "where": each.term.where,
        "parameters": each.term.parameters,
        "delta_rmse": before - after,
        "share_of_explainable": float(np.clip((before**2 - after**2) / explainable, 0.0, 1.0)),
        "confidence": each.confidence,
        "family": {
            "members": [{"id": name, "where": where} for name, where in each.family],
            "confidence": each.family_confidence,
        },
        "rivals": [
            {"id": name if name in library() else None, "name": name, "confidence": share}
            for name, share in each.alternatives
        ],
        "evidence": described(each),
        "begins": each.start,
        "added": each.status == "added",
        "a_year": None if cost is None else cost.as_json(),
    }


def unexplained(closed: Closed) -> str:
    """What remains, in words, with its evidence."""
    unknown = closed.selection.unknown
    if unknown is None:
        return remaining(closed)
    evidence = f"evidence {unknown.finding.evidence:.0f} (twice the log Bayes factor)"
    return f"{remaining(closed)}: {evidence}{_closest(closed)}"


def remaining(closed: Closed) -> str:
    """What remains, in words."""
    unknown = closed.selection.unknown
    if unknown is not None:
        since = f", {unknown.gate.label}" if unknown.gate.start else ""
        likeness = closed.correction.looks_like if closed.correction is not None else ""
        return f"{unnamed(unknown.finding.candidate.label)}{f', like {likeness}' if likeness else ''}{since}"
    rest = f"{closed.after.rmse:.2f} W RMS on held-out recordings, noise {closed.floor_W:.2f} W"
    if closed.reference_rmse is not None:
        return f"{rest}; the model's residual was {closed.reference_rmse:.2f} W when it was made"
    return rest


def _closest(closed: Closed) -> str:
    """The effect with the largest evidence beside an unknown structure, in words."""
    best = next((row for row in closed.hypotheses if row.id), None)
    whole = "of the library" if closed.subject.chosen == frozenset(library()) else "that was searched for"
    if best is None:
        return f"; no effect {whole} comes near"
    return f"; the closest effect {whole} is {best.id} ({best.where}) with {best.finding.evidence:.0f}"


def next_steps(closed: Closed) -> list[str]:
    """What to do, most useful first."""
    if closed.mistimed:
        return ["build the dataset again with power and motion of the same time"]
    steps = []
    for each in closed.named:
        effect = library()[each.term.id]
        if _doubted(each):
            near = [name for name, share in each.alternatives if share > _SHOWN_CONFIDENCE]
            steps.append(f"to distinguish {each.term.id} from {' or '.join(near)}: {effect.experiment}")
        else:
            steps.append(f"look for what has changed at: {changed_place(each)}; to confirm it: {effect.experiment}")
    if closed.verdict in ("unknown_structure", "not_identifiable") and (wander := wandering(closed)):
        steps.append(wander)
    if closed.verdict in ("nothing_left", "not_identifiable") and (sizes := smallest_in_words(closed.ability)):
        steps.append(f"smaller effects than these may be there all the same: {sizes}")
    if closed.verdict == "unknown_structure" or closed.correction is not None:
        steps.append(
            "ask what was changed in the cell, and log what may be the cause together with the power; "
            "figures below show which quantities the error follows"
        )
    if closed.verdict == "not_identifiable":
        seconds = closed.subject.fit_s
        few = seconds < THRESHOLDS.enough_s
        reason = f"{seconds:.0f} s are too few to distinguish an effect from noise: " if few else ""
        steps.append(f"{reason}record a dozen more recordings of a minute each, with other motions")
    open_question = closed.verdict == "not_identifiable" or any(map(_motion_helps, closed.named))
    if open_question and _designable(closed):
        steps.append("or let acqd next, with the folder of this report, design the motion that decides")
    return steps


def _designable(closed: Closed) -> bool:
    """Whether acqd next can design a motion that helps: collisions can be excluded, and there is a reference."""
    plannable = any(joint.capsules for joint in closed.subject.robot.joint)
    doubted = closed.verdict != "effects_found" or any(map(_motion_helps, closed.named))
    return plannable and bool(closed.subject.reference) and doubted


def _motion_helps(each: Reported) -> bool:
    near = [name for name, share in each.alternatives if share > _SHOWN_CONFIDENCE]
    open_name = each.confidence < SURE or bool(each.family)
    return open_name and _doubted(each) and not unmoved([each.term.id, *near])


def _doubted(each: Reported) -> bool:
    """Whether another cause is likely enough to be worth an experiment."""
    return any(share > _SHOWN_CONFIDENCE for _, share in each.alternatives)
