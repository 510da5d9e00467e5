"""What the loop found, for machines (report.json) and for the engineer (report.html)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import ENOUGH_S, Closed
from acqd.discrepancy.repair.terms import Added, described
from acqd.discrepancy.report import figures
from acqd.models.effects import library
from acqd.report.page import Page

VERDICTS = {
    "effects_found": "An effect that the model lacks was found.",
    "nothing_left": "Nothing credible is left over.",
    "unknown_structure": "Something is left over that no effect of the library explains.",
    "not_identifiable": "Something is left over, but these recordings cannot tell what it is.",
}


def as_json(order: CloseConfig, closed: Closed) -> dict[str, Any]:
    """The fixed keys, and what else is worth knowing."""
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
        "effects": [_effect(closed, number) for number in range(len(closed.named))],
        "unexplained": unexplained(closed),
        "question": subject.question,
        "noise_floor_from": closed.floor_where,
        "reference_rmse": closed.reference_rmse,
        "joint_level": None if closed.joints is None else closed.joints.as_text(),
        "next": next_steps(closed),
        "notes": closed.notes,
        "model": {"name": subject.bundle.metadata["name"], "bundle": str(order.bundle)},
        "dataset": str(order.dataset),
        "seed": order.seed,
    }


def _effect(closed: Closed, number: int) -> dict[str, Any]:
    each = closed.named[number]
    after = closed.after.rmse
    before = after + _worth(closed, number)
    lowest = min(closed.after.rmse, closed.reference_rmse or np.inf)
    explainable = max(closed.before.rmse**2 - lowest**2, 1e-12)
    return {
        "id": each.term.id,
        "where": each.term.where,
        "parameters": each.term.parameters,
        "delta_rmse": before - after,
        "share_of_explainable": float(np.clip((before**2 - after**2) / explainable, 0.0, 1.0)),
        "confidence": each.confidence,
        "rivals": [{"id": name, "confidence": share} for name, share in each.rivals],
        "evidence": described(each),
        "begins": each.begin,
        "added": number < len(closed.kept),
    }


def _worth(closed: Closed, number: int) -> float:
    """W RMS on held-out recordings; none for what was not added."""
    return closed.improved.worth[number] if number < len(closed.kept) else 0.0


def unexplained(closed: Closed) -> str:
    """What remains, in words."""
    unknown = closed.tracing.unknown
    if unknown is not None:
        gate = closed.tracing.unknown_gate
        since = f", {gate.label}" if gate is not None and gate.begin else ""
        return (
            f"a structure that follows {unknown.candidate.label}{since}: {unknown.evidence:.0f} units of white squared "
            "error that no effect of the library explains as well"
        )
    rest = f"{closed.after.rmse:.2f} W RMS on held-out recordings, noise {closed.floor_W:.2f} W"
    if closed.reference_rmse is not None:
        return f"{rest}; the model left {closed.reference_rmse:.2f} W when it was made"
    return rest


def next_steps(closed: Closed) -> list[str]:
    """What to do, most useful first."""
    steps = []
    for each in closed.named:
        effect = library()[each.term.id]
        near = [name for name, share in each.rivals if share > 0.02] or list(effect.neighbours[:1])
        others = " or ".join(near)
        steps.append(f"to be sure that it is {each.term.id} and not {others}: {effect.experiment}")
    if closed.verdict == "unknown_structure":
        steps.append(
            "ask what was changed in the cell, and record what may drive it; the pictures show what it follows"
        )
    if closed.verdict == "not_identifiable":
        seconds = sum(len(segment.P) for segment in closed.subject.fit) * closed.subject.data.step_s
        few = f"{seconds:.0f} s are too few to tell an effect from noise: " if seconds < ENOUGH_S else ""
        steps.append(f"{few}record a dozen more recordings of a minute each, with other motions")
    return steps


def write_report(path: Path, order: CloseConfig, closed: Closed) -> None:
    """report.html. Raises UserError."""
    subject = closed.subject
    page = Page(f"What the model leaves over: {order.dataset.name}", simulated=subject.data.measured == "simulated")
    page.text(VERDICTS[closed.verdict] + (" " + _headline(closed) if closed.named else ""))
    if subject.data.measured == "derived":
        page.text("The power of this dataset is derived from other measurements, not metered.")
    question = "what has changed since the model was made" if subject.question == "change" else "what the model lacks"
    page.text(f"The question was {question}. Errors are of {len(subject.held_out)} stretches that were kept apart.")
    rows = [["before", *_numbers(closed.before)], ["after", *_numbers(closed.after)]]
    page.table(["", "MAE [W]", "RMSE [W]", "bias, prediction minus measurement [W]", "whiteness (0: noise)"], rows)
    floor = f"Noise of the measurement {closed.floor_where}: {closed.floor_W:.2f} W. "
    if closed.reference_rmse is not None:
        floor += f"The same model on the recordings that it remembers: {closed.reference_rmse:.2f} W RMS."
    page.text(floor)
    for number, each in enumerate(closed.named):
        _tell(page, closed, each, number)
    page.heading("What is left")
    page.text(unexplained(closed))
    for note in closed.notes:
        page.text(note)
    if closed.joints is not None:
        page.text("At the joints: " + closed.joints.as_text() + ".")
    if closed.tracing.looked_at:
        page.figure(
            figures.ranking(closed.tracing.looked_at, None),
            "The last look: how much every hypothesis would explain now.",
        )
    steps = next_steps(closed)
    if steps:
        page.heading("What to do next")
        for step in steps:
            page.text(step)
    page.heading("Evidence")
    page.figure(figures.example(closed), "A held-out recording, where the loop changed most.")
    page.figure(figures.by_recording(closed), "Every held-out stretch.")
    page.figure(
        figures.where(closed), "Where the residual lives (W, measured minus predicted): before (brown), after (blue)."
    )
    page.figure(
        figures.memory(closed, subject.data.step_s), "How much of the residual could be foreseen from the row before."
    )
    page.write(path)


def _headline(closed: Closed) -> str:
    names = "; ".join(f"{each.term.id} ({each.term.where})" for each in closed.named)
    return f"{names}. Held-out error {closed.before.rmse:.2f} -> {closed.after.rmse:.2f} W RMS."


def _numbers(quality: Any) -> list[float]:
    return [quality.mae, quality.rmse, quality.bias, quality.whiteness]


def _tell(page: Page, closed: Closed, each: Added, number: int) -> None:
    effect = library()[each.term.id]
    page.heading(f"{number + 1}. {each.term.id} - {each.term.where}")
    page.text(effect.summary[0].upper() + effect.summary[1:] + f". Equation: {effect.equation}.")
    page.text(described(each))
    rows = []
    for name, parameter in each.term.parameters.items():
        interval = parameter["ci95"]
        shown = f"{interval[0]:.4g} to {interval[1]:.4g}" if interval else "as found in the search"
        rows.append([name, float(parameter["value"]), parameter["unit"], shown])
    page.table(["parameter", "value", "unit", "95 % interval"], rows)
    rivals = ", ".join(f"{name} {share:.0%}" for name, share in each.rivals) or "none"
    page.text(
        f"Confidence {each.confidence:.0%} (share of resampled sets of recordings in which it explains most); "
        f"rivals: {rivals}. "
        + (
            f"Without it, the held-out RMSE is {_worth(closed, number):.2f} W higher."
            if number < len(closed.kept)
            else "When it acts cannot be foreseen: it is not part of the model."
        )
    )
    named = next(
        (n for n in closed.tracing.found if n.id == each.term.id and n.finding.candidate.label == each.term.where), None
    )
    if named is not None:
        page.figure(
            figures.explained(closed, named),
            "Left: what is left over without the effect against what the effect says; right: its strength over time.",
        )
        page.figure(figures.ranking([named.finding, *named.rivals], named.id), "How much each hypothesis explains.")
