"""The result of the loop for the engineer (report.html)."""

from __future__ import annotations

from pathlib import Path

from acqd.discrepancy.ability.ability import Ability, table_of
from acqd.discrepancy.ability.smallest import POWER
from acqd.discrepancy.causes.belief import shipped
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.repair.terms import Reported
from acqd.discrepancy.report import causes, charts, figures
from acqd.discrepancy.report.arm import arm_view
from acqd.discrepancy.report.summary import VERDICTS, remaining
from acqd.discrepancy.report.tile import tile
from acqd.discrepancy.selection.accepted import Hypothesis, Selected
from acqd.models.bundle.bundle import fingerprint
from acqd.models.effects import library
from acqd.report.digits import counted, interval_of, number, percent, with_error
from acqd.report.page import Page
from acqd.residual.quality import Quality

_EVIDENCE = (
    "Evidence is twice the log Bayes factor against the model without the effect: 10 is strong, and it grows with the "
    "number of rows. It says that something is there; how likely a cause is among the others, its confidence says."
)
_QUESTIONS = {
    "change": "what has changed since the model was made",
    "structure": "what the model lacks in all recordings",
}


def write_report(path: Path, config: CloseConfig, closed: Closed) -> None:
    """Write the page. Raises UserError."""
    subject = closed.subject
    page = Page(
        f"Error of the model on {config.dataset.name}",
        simulated=subject.data.measured == "simulated", kind="closing report", subject=subject.data.robot,
        joints=subject.robot.joint_names,
    )  # fmt: skip
    page.verdict(tile(closed, config.duty))
    if subject.data.measured == "derived":
        page.text("The power of this dataset is derived from other measurements, not metered.")
    chart, recording = charts.example(closed)
    chosen = "the loop changed most" if closed.extended else "the error is largest"
    page.lines(
        chart, f"Where {chosen}, a minute at most: held-out recording {recording}. Error: measured minus predicted."
    )
    _causes(page, closed)
    page.heading("The arm, its power and the residual")
    page.arm(arm_view(closed))
    _errors(page, closed)
    for number_, effect in enumerate(closed.named):
        _effect(page, closed, effect, number_)
    if closed.correction is not None:
        _correction(page, closed.correction)
    _rest(page, closed)
    _evidence(page, closed)
    _ability(page, closed.ability)
    for name, value in _sources(config, closed).items():
        page.detail(name, value)
    page.write(path)


def _causes(page: Page, closed: Closed) -> None:
    belief = causes.believed(closed)
    if belief is None:
        return
    page.heading("What may be the cause")
    lead = causes.leading(closed) is not None
    page.text(_sentence(causes.text(closed, belief)))
    if lead:
        page.text("Probabilities are the confidence in the effect with the largest evidence, and in its rivals.")
        return
    cases = shipped().source.partition(" (")[0]  # without the names of the plants
    page.text(f"Probabilities are calibrated on {cases}. Plants of another kind may be missed more often.")


def _errors(page: Page, closed: Closed) -> None:
    page.heading("Errors on held-out recordings")
    page.text(f"{VERDICTS[closed.verdict]} The question was {_QUESTIONS[closed.subject.question]}.")
    head = ["", "MAE [W]", "RMSE [W]", "bias, predicted minus measured [W]", "residual autocorrelation (0: white)"]
    rows = [["before" if closed.extended else "model", *_numbers(closed.before)]]
    page.table(head, [*rows, ["after", *_numbers(closed.after)]] if closed.extended else rows)
    page.text(f"{len(closed.subject.held_out)} held-out segments, which no fit has seen. {_floor(closed)}")
    page.figure(figures.by_recording(closed), "All held-out segments in the order of time.")


def _floor(closed: Closed) -> str:
    floor = (
        f"Noise floor {closed.floor_source}: {closed.floor_W:.2f} W RMS (the part of the measured power that no model "
        "of motion can predict)."
    )
    if closed.reference_rmse is None:
        return floor
    return f"{floor} The same model on its reference recordings: {closed.reference_rmse:.2f} W RMS."


def _numbers(figures_of: Quality) -> list[str]:
    values = (figures_of.mae, figures_of.rmse, figures_of.bias, figures_of.residual_autocorrelation)
    return [f"{value:.2f}" for value in values]


def _rest(page: Page, closed: Closed) -> None:
    page.heading("Remaining residual")
    page.text(_sentence(remaining(closed)))
    for note in closed.notes:
        if note not in closed.warnings:
            page.text(_sentence(note))
    if closed.joints is not None:
        page.heading("Torques at the joints")
        page.text(_sentence(closed.joints.as_text()))
        caption = (
            "Logged torque against the reference's model; in the titles: RMS difference now (in the reference). "
            "Line: equality."
        )
        page.figure(figures.joints(closed.joints), caption)
    if closed.hypotheses:
        page.heading("Hypotheses that were not accepted")
        with page.folded("Evidence, what is missing, and the recording that would decide"):
            page.text(_EVIDENCE)
            rows = [
                [
                    _named(each), number(each.finding.evidence), number(each.margin), "; ".join(each.missing),
                    each.experiment,
                ]
                for each in closed.hypotheses
            ]  # fmt: skip
            page.table(["hypothesis", "evidence", "needed", "missing", "what would decide"], rows)


def _evidence(page: Page, closed: Closed) -> None:
    page.heading("Evidence")
    page.figure(figures.along(closed), "Residual along recorded quantities. Line: mean; band: RMS.")
    page.lines(charts.correlation(closed), "Autocorrelation of the residual: what one row says about later rows.")


def _ability(page: Page, ability: Ability) -> None:
    header, *rows = table_of(ability)
    if not rows:
        return
    page.heading("What these recordings can tell")
    page.text(
        f"An effect of the size below is told from nothing with a probability of {percent(POWER)}. A rival is told "
        "apart from the size behind its name on; without a size, no minutes of this motion suffice."
    )
    page.table(header, rows)
    if ability.unseen:
        page.text(f"Not judged: {'; '.join(f'{name} ({why})' for name, why in ability.unseen)}.")


def _effect(page: Page, closed: Closed, each: Reported, index: int) -> None:
    effect = library()[each.term.id]
    page.heading(f"Effect {index + 1}: {each.term.id}, {each.term.where}")
    page.text(_sentence(_agreement(each)))
    page.text(_confidence(each))
    page.bars(charts.beliefs(each), f"What separates them: {effect.experiment}.")
    selected = next(
        (n for n in closed.selection.effects if n.id == each.term.id and n.place.where == each.term.where), None
    )
    if selected is not None:
        page.figure(
            figures.explained(closed.strengths[selected.key], selected.id),
            "Left: residual without the effect against the effect's power. Right: strength of the effect over time.",
        )
    with page.folded("Parameters and equation"):
        page.table(["parameter", "value", "unit", "95 % interval"], _parameters(each))
        page.text(f"Equation: {effect.equation}.")
    if selected is not None:
        with page.folded("Evidence of the hypotheses that competed"):
            page.text(_EVIDENCE)
            page.table(["hypothesis", "evidence"], _competed(selected))


def _agreement(each: Reported) -> str:
    """What the effect is, since when, and how many recordings say so."""
    since = f", since {each.start}" if each.start else ""
    shifted = " are shifted the same way" if each.evidence is None else " agree"
    count = f"{percent(each.consistency)} of {counted(each.recordings, 'recording')}"
    return f"{library()[each.term.id].summary} ({each.term.where}{since}): {count}{shifted}"


def _named(each: Hypothesis) -> str:
    sizes = ", ".join(f"{number(value)} {unit}" for value, unit in each.parameters.values())
    return f"{each.name}{f' {each.where}' if each.id else ''}{f' ({sizes})' if sizes else ''}"


def _competed(selected: Selected) -> list[list[str]]:
    """The strongest place of every hypothesis with its evidence."""
    best: dict[str, Hypothesis] = {}
    for row in sorted(selected.table, key=lambda row: -row.finding.evidence):
        best.setdefault(row.name, row)
    return [[_named(row), number(row.finding.evidence)] for row in best.values() if row.finding.evidence > 0]


def _correction(page: Page, correction: Correction) -> None:
    page.heading("Correction without a name")
    since = f", since {correction.begins}" if correction.begins else ""
    looks = f", like {correction.looks_like}," if correction.looks_like else ""
    page.text(
        f"{_sentence(correction.follows)[:-1]}{looks} is part of the repaired model{since}. The correction predicts "
        f"power and does not say what causes it. Without the correction, the held-out RMSE is "
        f"{number(correction.gain)} W higher."
    )
    page.figure(figures.law(correction), "The law as fitted, in the rows in question.")
    with page.folded("Size and equation"):
        size = correction.size
        low_high = size["ci95"]
        bounds = interval_of((low_high[0], low_high[1]), correction.recordings) if low_high else "no interval"
        page.table(
            ["", "value", "unit", "95 % interval"],
            [["not exceeded in 95 % of the rows in which the law acts", number(size["value"]), size["unit"], bounds]],
        )
        page.text(f"Equation: {correction.part.law.equation}.")


def _parameters(each: Reported) -> list[list[str]]:
    rows = []
    for name, parameter in each.term.parameters.items():
        value, interval = float(parameter["value"]), parameter["ci95"]
        shown = with_error(value, (interval[1] - interval[0]) / 2) if interval else number(value)
        bounds = interval_of((interval[0], interval[1]), each.recordings) if interval else "no interval"
        rows.append([name, shown, parameter["unit"], bounds])
    return rows


def _confidence(each: Reported) -> str:
    near = [(name, share) for name, share in each.alternatives if share >= charts.LEAST_CONFIDENCE]
    others = ", ".join(f"{name} {percent(share)}" for name, share in near)
    others = others or f"none with {percent(charts.LEAST_CONFIDENCE)} or more"
    if each.family:
        kin = ", ".join(f"{name} ({where})" for name, where in each.family)
        others += f". Nearly the same power in these recordings: {kin}; together {percent(each.family_confidence)}"
    if each.status == "added":
        gain = f"Without the effect, the held-out RMSE is {number(each.gain_W)} W higher."
    else:
        gain = "The effect is reported only: it is not part of the model."
    return (
        f"Confidence {percent(each.confidence)} (that the effect explains more than its alternatives); "
        f"alternative explanations: {others}. {gain}"
    )


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _sources(config: CloseConfig, closed: Closed) -> dict[str, str]:
    return {
        "seed": str(config.seed),
        "dataset": str(config.dataset),
        "dataset SHA-256": closed.subject.data.digest,
        "model": str(config.bundle),
        "model SHA-256": fingerprint(config.bundle),
    }
