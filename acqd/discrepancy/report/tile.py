"""The verdict of the loop as a tile: what was found, how much, how sure, and what to do next."""

from __future__ import annotations

import re
from typing import Any

from acqd.discrepancy.causes.belief import NOTHING
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.repair.terms import Reported
from acqd.discrepancy.report import causes
from acqd.discrepancy.report.cost import cost_figure, cost_of
from acqd.discrepancy.report.main_parameter import changed_place, main_parameter
from acqd.discrepancy.report.relevance import compared_with_robot, mean_power
from acqd.discrepancy.report.summary import next_steps
from acqd.discrepancy.selection.accepted import unnamed
from acqd.models.effects import library
from acqd.models.yearly import Duty
from acqd.report.digits import confidence_interval, counted, number, percent, with_error
from acqd.report.verdict import KeyFigure, Tone, Verdict

_TONES: dict[str, Tone] = {
    "effects_found": "found", "nothing_left": "fine", "unknown_structure": "open", "not_identifiable": "open"
}  # fmt: skip
_SHOWN_EFFECTS = 3
_MOST_CAUSES = 3
_EITHER = re.compile(r"(\w+) \(or (\w+)\)")


def tile(closed: Closed, duty: Duty) -> Verdict:
    """What a plant engineer needs within a minute; `duty`: for the cost of a year."""
    figures = (
        _how_much(closed)
        + _how_sure(closed)
        + _causes(closed)
        + mean_power(closed)
        + _costs(closed, duty)
        + [_error(closed)]
    )
    warnings = [f"{_capital(warning)}." for warning in closed.warnings]
    return Verdict(_TONES[closed.verdict], _headline(closed), _sentence(closed), figures, next_steps(closed), warnings)


def _headline(closed: Closed) -> str:
    if closed.verdict == "effects_found":
        named = ", ".join(f"{each.term.id} ({changed_place(each)})" for each in closed.named)
        return f"{'Cause' if len(closed.named) == 1 else 'Causes'} found: {named}"
    if closed.verdict == "unknown_structure":
        return "The power has changed in a way that no known effect explains"
    if closed.verdict == "not_identifiable":
        belief = causes.believed(closed)
        if belief is not None and NOTHING in belief.members and belief.probabilities[NOTHING] >= causes.LEAST:
            return "These recordings cannot tell whether anything has changed"
        return "Something differs, but these recordings cannot tell what"
    return "No credible effect: the model explains the power as far as these recordings show"


def _sentence(closed: Closed) -> str:
    if closed.verdict == "unknown_structure" and closed.selection.unknown is not None:
        unknown = closed.selection.unknown
        since = f", since {unknown.gate.start}" if unknown.gate.start else ""
        what = f"The error of the model looks like {unnamed(unknown.finding.candidate.label)}{since}"
        likeness = closed.correction.looks_like if closed.correction is not None else ""
        return f"{what}, namely {likeness}." if likeness else f"{what}."
    sentences = [directed(library()[each.term.id].summary, main_parameter(each)[1]) for each in closed.named]
    since = next((f" It begins with {each.start}." for each in closed.named if each.start), "")
    perhaps = "Perhaps: " if closed.verdict == "not_identifiable" and sentences else ""
    return _capital(perhaps + "; ".join(sentences) + f".{since}") if sentences else _reason(closed)


def directed(summary: str, parameter: dict[str, Any]) -> str:
    """ "higher (or lower)" as what the parameter says: "higher" if its interval is positive, "lower" if negative."""
    low, high = parameter["ci95"] or (parameter["value"], parameter["value"])
    if low > 0:
        return _EITHER.sub(r"\1", summary)
    return _EITHER.sub(r"\2", summary) if high < 0 else summary


def _reason(closed: Closed) -> str:
    return _capital(f"{closed.notes[-1]}.") if closed.notes and closed.verdict == "not_identifiable" else ""


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _how_much(closed: Closed) -> list[KeyFigure]:
    if closed.named or closed.verdict != "unknown_structure":
        sizes = [_size(closed.subject, each) for each in closed.named[:_SHOWN_EFFECTS]]
        return sizes if closed.correction is None else [*sizes, _size_of_law(closed.correction)]
    usual = closed.floor_W if closed.reference_rmse is None else closed.reference_rmse
    excess = max(closed.before.rmse**2 - usual**2, 0.0) ** 0.5
    power = KeyFigure("power of unknown cause", f"{number(excess)} W RMS", f"with the usual {number(usual, 2)} W apart")
    return [power] if closed.correction is None else [power, _size_of_law(closed.correction)]


def _size_of_law(correction: Correction) -> KeyFigure:
    bounds = correction.size["ci95"]
    interval = confidence_interval((bounds[0], bounds[1]), correction.recordings) if bounds else ""
    note = "less in 95 % of the rows in which it acts; the repaired model contains it, whatever the cause is"
    size = f"up to {number(float(correction.size['value']))} {correction.unit}"
    return KeyFigure("size of what has no name", size, _joined(interval, note))


def _size(subject: Subject, each: Reported) -> KeyFigure:
    """The main parameter of an effect with its interval, and beside what the robot has; signed if it can be either."""
    name, parameter = main_parameter(each)
    value, unit, bounds = float(parameter["value"]), parameter["unit"], parameter["ci95"]
    label, usual = f"{each.term.id}: {name}", compared_with_robot(subject, each)
    if not bounds:
        return KeyFigure(label, f"{number(value)} {unit}", _joined(counted(each.recordings, "recording"), usual))
    note = _joined(confidence_interval((bounds[0], bounds[1]), each.recordings), usual)
    plus = "+" if value > 0 and _EITHER.search(library()[each.term.id].summary) else ""
    return KeyFigure(label, f"{plus}{with_error(value, (bounds[1] - bounds[0]) / 2)} {unit}", note)


def _joined(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


def _how_sure(closed: Closed) -> list[KeyFigure]:
    if closed.named:
        sure = " and ".join(percent(each.confidence) for each in closed.named[:_SHOWN_EFFECTS])
        return [KeyFigure("how sure", sure, "that the effect explains more than its alternatives")]
    unknown = closed.selection.unknown
    if unknown is None or closed.verdict != "unknown_structure":
        return []
    best = next((each for each in closed.hypotheses if each.id), None)
    if best is None:
        return [KeyFigure("closest known effect", "none", "no effect that was searched for comes near")]
    share = percent(min(max(best.finding.evidence, 0.0) / unknown.finding.evidence, 1.0))
    lacks = f"; missing: {'; '.join(best.missing)}" if best.missing else ""
    return [KeyFigure("closest known effect", best.id, f"has {share} of the evidence{lacks}")]


def _causes(closed: Closed) -> list[KeyFigure]:
    """The set of causes, where that is short enough to look for each of them."""
    belief = None if causes.leading(closed) is not None else causes.believed(closed)  # else that is "how sure"
    if belief is None or len(belief.members) > _MOST_CAUSES:
        return []
    likely = [label for label in belief.members if belief.probabilities[label] >= causes.LEAST] or belief.members[:1]
    shares = ", ".join(percent(belief.probabilities[label]) for label in likely)
    names = " or ".join(map(causes.name_of, likely))
    return [KeyFigure("largest cause", names, f"{shares}; calibrated on simulated plants")]


def _costs(closed: Closed, duty: Duty) -> list[KeyFigure]:
    costs = [(each, cost_of(closed, each, duty)) for each in closed.named[:_SHOWN_EFFECTS]]
    return [cost_figure(each, cost) for each, cost in costs if cost is not None]


def _error(closed: Closed) -> KeyFigure:
    """Held-out error before and after, and the least that the recordings permit."""
    before, after = number(closed.before.rmse), number(closed.after.rmse)
    value = f"{before} → {after} W" if closed.extended else f"{before} W"
    held_out = counted(len({segment.recording for segment in closed.subject.held_out}), "recording")
    was = f"; {number(closed.reference_rmse, 2)} W when the model was made" if closed.reference_rmse is not None else ""
    return KeyFigure("error (RMS), held out", value, f"{held_out}; noise {number(closed.floor_W, 2)} W{was}")
