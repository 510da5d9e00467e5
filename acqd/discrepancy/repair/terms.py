"""Found effects as terms of a model, and a guard that keeps only those that help on recordings nobody has used."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.residual.delay import Delay
from acqd.discrepancy.selection.stepwise import Named
from acqd.discrepancy.selection.uncertainty import confidence, intervals, others
from acqd.models.augmented import Augmented, Term
from acqd.models.effects import library
from acqd.models.effects.places import Parameter, Place
from acqd.models.effects.substeps import RADIUS
from acqd.models.features import padded
from acqd.models.metrics import predictions, signals_of
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment

_FOLLOWS_CLOCK = ("thermal_friction", "clock_drift")


@dataclass(frozen=True, slots=True)
class Added:
    """One effect as the report has it."""

    term: Term
    evidence: float
    """White sum of squares."""
    confidence: float
    rivals: list[tuple[str, float]]
    begin: str | None
    """First recording, when it was not there from the start."""
    consistency: float
    recordings: int
    """In which it acts."""
    restored: bool = False
    """It came back as parameters of the grey box that had been denied them, not as a term."""


def added(design: Design, model: Any, named: Named, seed: int) -> Added:
    """Parameters with intervals, confidence and rivals of one found effect."""
    sure, rivals = confidence(design, named.model, named, seed)
    values, half = intervals(design, others(design, model, named), named, named.gate)
    about = _parameters(named, values, half)
    shape = dict(named.shape)
    origin = min(part.start_s for part in design.parts if part.in_question)
    if named.id in _FOLLOWS_CLOCK:
        shape["origin_s"] = origin
    if named.gate.begin is not None:
        shape["begin_s"] = min(part.start_s for part, own in zip(design.parts, named.gate.open, strict=True) if own)
    term = Term.of(named.id, named.place, shape, values, about)
    finding = named.finding
    recordings = len({part.recording for part, own in zip(design.parts, named.gate.open, strict=True) if own})
    return Added(term, finding.evidence, sure, rivals, named.gate.begin, finding.consistency, recordings)


def _parameters(named: Named, values: Floats, half: Floats) -> dict[str, Any]:
    about: dict[str, Any] = {}
    for parameter, value, width in zip(named.place.parameters, values, half, strict=True):
        interval = [float(value - width), float(value + width)]
        about[parameter.name] = {"value": float(value), "unit": parameter.unit, "ci95": interval}
    for name, value in named.shape.items():
        about[name] = {"value": float(value), "unit": _unit(name), "ci95": None}
    return about


def _unit(name: str) -> str:
    endings = {"_W": "W", "_m": "m", "_rad_s": "rad/s", "_s": "s", "minutes": "min", "_hour": "s/h"}
    return next((unit for ending, unit in endings.items() if name.endswith(ending)), "-")


def clock_term(delay: Delay) -> Added:
    """What was found before tracing: power and motion apart."""
    value, error = delay.offset_s, 1.96 * delay.offset_error_s
    offset = {"value": value, "unit": "s", "ci95": [value - error, value + error]}
    delays = np.array([each for _, each in delay.single])
    agree = float((np.sign(delays) == np.sign(np.median(delays))).mean())
    if delay.drifts:
        rate, rate_error = 3600 * delay.rate, 1.96 * 3600 * delay.rate_error
        parameters = {
            "power later by, at the begin": offset,
            "and by more each hour": {"value": rate, "unit": "s/h", "ci95": [rate - rate_error, rate + rate_error]},
        }
        shape = {"seconds": value, "seconds_per_hour": rate, "origin_s": delay.origin_s}
        place = Place("clocks", (0,), (Parameter("power later by", "s"),))
        term = Term.of("clock_drift", place, shape, np.ones(1), parameters)
        return Added(term, np.inf, 0.99, [("clock_offset", 0.01)], None, agree, len(delays))
    place = Place("clocks", (0,), (Parameter("power later by", "s"),))
    term = Term.of("clock_offset", place, {"seconds": value}, np.ones(1), {"power later by": offset})
    return Added(term, np.inf, 0.99, [("clock_drift", 0.01)], None, agree, len(delays))


def scaled(term: Term, factor: float) -> Term:
    """The same effect, taken by a share."""
    return replace(term, coefficients=term.coefficients * factor)


def guarded(
    base: Predictor, terms: list[Added], carrier: Any, held_out: list[Segment]
) -> tuple[list[Added], list[Added], list[Floats], list[float]]:
    """Terms that help on `held_out`, those that do not, the residuals, and what each kept term is worth (W RMS).

    From all of them together, the one that does most harm goes first: two effects may help only together.
    """
    kept = list(terms)
    while True:
        errors = _errors_with(base, kept, carrier, held_out)
        without = [rms(_errors_with(base, [o for o in kept if o is not each], carrier, held_out)) for each in kept]
        worth = [rmse - rms(errors) for rmse in without]
        if not kept or min(worth) > 0:
            return kept, [each for each in terms if all(each is not other for other in kept)], errors, worth
        kept.pop(int(np.argmin(worth)))


def _errors_with(base: Predictor, terms: list[Added], carrier: Any, held_out: list[Segment]) -> list[Floats]:
    return errors_of(Augmented.of(base, carrier, [each.term for each in terms]), held_out)


def errors_of(model: Predictor, segments: list[Segment]) -> list[Floats]:
    """[T] W measured minus predicted, for each stretch; see `residuals`."""
    return residuals(predictions(model, segments), segments)


def residuals(predicted: list[Floats], segments: list[Segment]) -> list[Floats]:
    """[T] W measured minus predicted, for each stretch.

    A log that ends in motion does not say how it went on: its outermost rows are not judged, they get their
    neighbour's residual.
    """
    found = [s.P - guess for s, guess in zip(segments, predicted, strict=True)]
    for errors in found:
        errors[:RADIUS], errors[-RADIUS:] = errors[RADIUS], errors[-RADIUS - 1]
    return found


def without_known(model: Predictor, segments: list[Segment]) -> list[Segment]:
    """Stretches without the power of effects that the model has already."""
    if not isinstance(model, Augmented):
        return segments
    known = [model.known(signals_of(model, s), len(s.P)) for s in segments]
    return [
        replace(s, P=s.P - model.effects(padded(s.q, RADIUS), signals, s.start_s))
        for s, signals in zip(segments, known, strict=True)
    ]


def rms(errors: list[Floats]) -> float:
    """W."""
    return float(np.sqrt((np.concatenate(errors) ** 2).mean()))


def described(each: Added) -> str:
    """One sentence of evidence for report.json."""
    effect = library()[each.term.id]
    since = f", since {each.begin}" if each.begin else ""
    if np.isinf(each.evidence):
        return f"{effect.summary}: {each.consistency:.0%} of {each.recordings} recordings are shifted the same way"
    return (
        f"{effect.summary} ({each.term.where}{since}): explains {each.evidence:.0f} units of white squared error "
        f"beyond chance; {each.consistency:.0%} of {each.recordings} recordings agree"
    )
