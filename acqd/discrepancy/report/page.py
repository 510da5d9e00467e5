"""The result of the loop for the engineer (report.html)."""

from __future__ import annotations

from pathlib import Path

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import Closed
from acqd.discrepancy.repair.terms import Added, described
from acqd.discrepancy.report import figures
from acqd.discrepancy.report.summary import VERDICTS, held_out_gain, next_steps, unexplained
from acqd.discrepancy.residual.quality import Quality
from acqd.models.effects import library
from acqd.report.page import Page

_QUESTIONS = {
    "change": "what has changed since the model was made",
    "structure": "what the model lacks in all recordings",
}


def write_report(path: Path, config: CloseConfig, closed: Closed) -> None:
    """Write the page. Raises UserError."""
    subject = closed.subject
    page = Page(f"Residual of the model on {config.dataset.name}", simulated=subject.data.measured == "simulated")
    page.text(VERDICTS[closed.verdict] + (" " + _headline(closed) if closed.named else ""))
    if subject.data.measured == "derived":
        page.text("The power of this dataset is derived from other measurements, not metered.")
    page.text(f"The question was {_QUESTIONS[subject.question]}.")
    page.text(f"Errors are measured on {len(subject.held_out)} held-out segments, which no fit has seen.")
    rows = [["before", *_numbers(closed.before)], ["after", *_numbers(closed.after)]]
    head = [
        "",
        "MAE [W]",
        "RMSE [W]",
        "bias, predicted minus measured [W]",
        "residual autocorrelation (0: white noise)",
    ]
    page.table(head, rows)
    page.text(_floor(closed))
    for number, effect in enumerate(closed.named):
        _effect(page, closed, effect, number)
    _rest(page, closed)
    steps = next_steps(closed)
    if steps:
        page.heading("What to do next")
        for step in steps:
            page.text(step)
    page.heading("Evidence")
    page.figure(figures.example(closed), "A held-out recording, where the loop changed most.")
    page.figure(figures.by_recording(closed), "All held-out segments.")
    page.figure(figures.along(closed), "Residual along recorded quantities: before (brown), after (blue).")
    page.figure(figures.correlation(closed), "Autocorrelation of the residual: what one row says about later rows.")
    page.write(path)


def _headline(closed: Closed) -> str:
    names = "; ".join(f"{each.term.id} ({each.term.where})" for each in closed.named)
    return f"{names}. Held-out error {closed.before.rmse:.2f} -> {closed.after.rmse:.2f} W RMS."


def _floor(closed: Closed) -> str:
    floor = (
        f"Noise floor {closed.floor_source}: {closed.floor_W:.2f} W RMS (the part of the measured power that no model "
        "of motion can predict)."
    )
    if closed.reference_rmse is None:
        return floor
    return f"{floor} The same model on its reference recordings: {closed.reference_rmse:.2f} W RMS."


def _numbers(figures_of: Quality) -> list[float]:
    return [figures_of.mae, figures_of.rmse, figures_of.bias, figures_of.residual_autocorrelation]


def _rest(page: Page, closed: Closed) -> None:
    page.heading("Remaining residual")
    page.text(unexplained(closed))
    for note in closed.notes:
        page.text(note)
    if closed.joints is not None:
        page.text("At the joints: " + closed.joints.as_text() + ".")
    if closed.tracing.hypotheses:
        page.heading("Hypotheses that were not accepted")
        for hypothesis in closed.tracing.hypotheses:
            page.text(f"{hypothesis.as_text()}. What would decide: {hypothesis.experiment}.")
    if closed.joints is not None:
        page.figure(figures.joints(closed.joints), "Logged torque against the reference's model, joint by joint.")
    if closed.tracing.last_ranking:
        ranking = figures.ranking(closed.tracing.last_ranking, None)
        page.figure(ranking, "The last ranking: how much every hypothesis would explain now.")


def _effect(page: Page, closed: Closed, each: Added, number: int) -> None:
    effect = library()[each.term.id]
    page.heading(f"{number + 1}. {each.term.id} - {each.term.where}")
    sentence = described(each)
    page.text(f"{sentence[0].upper()}{sentence[1:]}. Equation: {effect.equation}.")
    rows = []
    for name, parameter in each.term.parameters.items():
        interval = parameter["ci95"]
        shown = f"{interval[0]:.4g} to {interval[1]:.4g}" if interval else "no interval"
        rows.append([name, float(parameter["value"]), parameter["unit"], shown])
    page.table(["parameter", "value", "unit", "95 % interval"], rows)
    page.text(_confidence(closed, each, number))
    named = next((n for n in closed.tracing.effects if n.id == each.term.id and n.place.where == each.term.where), None)
    if named is not None:
        page.figure(
            figures.explained(closed, named),
            "Left: residual without the effect against the effect's power. Right: strength of the effect over time.",
        )
        page.figure(figures.ranking([named.finding, *named.alternatives], named.id), "Evidence for the hypotheses.")


def _confidence(closed: Closed, each: Added, number: int) -> str:
    others = ", ".join(f"{name} {share:.0%}" for name, share in each.alternatives) or "none"
    if each.family:
        kin = ", ".join(f"{name} ({where})" for name, where in each.family)
        others += f". Nearly the same power in these recordings: {kin}; together {each.family_confidence:.0%}"
    if number < len(closed.kept):
        gain = f"Without the effect, the held-out RMSE is {held_out_gain(closed, number):.2f} W higher."
    else:
        gain = "The effect is reported only: it is not part of the model."
    return (
        f"Confidence {each.confidence:.0%} (of naming the effect again from other recordings of this kind); "
        f"alternative explanations: {others}. {gain}"
    )
