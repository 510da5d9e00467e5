"""Selected effects as terms of a model, with intervals, confidence and alternatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.special import expit

from acqd.arrays import Floats
from acqd.discrepancy.delay import Delay
from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.selection.accepted import Hypothesis, Selected, Selection, Unknown
from acqd.discrepancy.selection.confidence import confidence
from acqd.discrepancy.selection.shape_interval import Fit
from acqd.discrepancy.selection.uncertainty import Intervals, intervals
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.augmented import ORIGIN, Term
from acqd.models.effects import library
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place
from acqd.models.greybox.model import GreyBox
from acqd.report.digits import percent

FIRST_MOMENT = "first moment about the last axis"
"""Parameter of a report: of a mass beside the last axis."""
_UNITS = {
    "_W": "W", "_V": "V", "_m": "m", "_rad_s": "rad/s", "_s": "s", "minutes": "min", "_hour": "s/h"
}  # fmt: skip
"""Unit of a shape parameter by the ending of its name; the first match holds."""


Status = Literal["named", "added", "reported", "hypothesis", "refused"]
"""Not judged yet; in the model; named, not in the model; another cause may be there; no cause may be there."""


@dataclass(frozen=True, slots=True)
class Reported:
    """An effect as the report shows it."""

    term: Term
    hypothesis: Hypothesis | None
    """Of the table in which the effect leads; None: shifts of whole recordings show the effect."""
    confidence: float
    alternatives: tuple[tuple[str, float], ...]
    """Ids of other effects, or unnamed alternatives in words, and their confidence."""
    start: str | None
    """First recording with the effect; None: all recordings have it."""
    consistency: float
    """Share of recordings that agree."""
    recordings: int
    """Number of recordings in which the effect may act."""
    family: tuple[tuple[str, str], ...] = ()
    """Ids and places of effects that these recordings cannot tell from this one."""
    family_confidence: float = 0.0
    """Together with the family; at least `confidence`."""
    doubt: Unknown | None = None
    """An unnamed alternative that is likelier than the family."""
    possible: bool = True
    """Whether physics permits the sizes."""
    restored: bool = False
    """The effect came back as parameters that the grey box had been denied, not as a term."""
    status: Status = "named"
    missing: str = ""
    """What a hypothesis or a refused effect lacks, in words."""
    gain_W: float = 0.0
    """W RMS by which an added effect reduces the held-out error."""

    @property
    def evidence(self) -> float | None:
        """Twice the log Bayes factor against no effect; None for shifts of whole recordings."""
        return None if self.hypothesis is None else self.hypothesis.finding.evidence

    @property
    def may_be_nothing(self) -> bool:
        """Whether all intervals of sizes hold zero; never for what shifts of whole recordings show.

        The interval of a shape says nothing: a power from which clipping begins is never zero.
        """
        sizes = [each["ci95"] for name, each in self.term.parameters.items() if name not in self.term.shape]
        known = [ends for ends in sizes if ends is not None]
        return self.hypothesis is not None and bool(known) and all(low <= 0.0 <= high for low, high in known)

    @property
    def key(self) -> str:
        """Identity within a report: an effect is added once at a place, or once from shifts of whole recordings."""
        return f"{self.term.id} {self.term.where}{' (whole recordings)' if self.evidence is None else ''}"

    def without_name(self, status: Status, missing: str) -> Reported:
        """The effect as no finding, with the reason."""
        return replace(self, status=status, missing=missing)

    def as_hypothesis(self) -> Hypothesis | None:
        """A row of the table of hypotheses, for an effect that is no finding."""
        if self.hypothesis is None:
            return None
        return replace(self.hypothesis, status="refused", missing=(self.missing,))


def reported(selection: Selection, selected: Selected, scale: TorqueScale) -> Reported:
    """Parameters with intervals, confidence and alternatives of a selected effect."""
    sure, certain = confidence(selection, selected), intervals(selection, selected)
    shape = dict(selected.shape)
    design = selection.design
    if library()[selected.id].follows_clock:
        shape |= _session_starts(selection, library()[selected.id])
    open_ = [part for part, acts in zip(design.parts, selected.gate.open, strict=True) if acts]
    if selected.gate.start is not None:
        shape["begin_s"] = min(part.start_s for part in open_)  # the key that bundles have
    term = Term.of(
        selected.id,
        selected.place,
        shape,
        certain.coefficients,
        _parameters(selected, certain, scale, design.columns.model),
    )
    return Reported(
        term=term, hypothesis=selected.hypothesis, confidence=sure.share, alternatives=sure.rivals,
        start=selected.gate.start, consistency=sure.agreeing, recordings=len({part.recording for part in open_}),
        family=sure.family, family_confidence=sure.family_share, doubt=sure.doubt,
        possible=sure.possible,
    )  # fmt: skip


def _session_starts(selection: Selection, effect: Effect) -> dict[str, float]:
    """UTC of the start of the sessions in question, s, in the keys of a bundle; gears started with their work."""
    scenes = selection.design.columns.scenes
    asked = [scenes.memory(number) for number, side in enumerate(scenes.in_question) if side]
    worked = 0.0 if effect.acts_on == "clock" else 1.0
    origins = sorted({float(memory["origin_s"] - worked * memory["worked_s"]) for memory in asked})
    return {f"{ORIGIN}_{k}" if k else ORIGIN: origin for k, origin in enumerate(origins)}


def _parameters(selected: Selected, certain: Intervals, scale: TorqueScale, model: GreyBox) -> dict[str, Any]:
    """In true units; the coefficients of a term are in the scale of its model's torques."""
    parameters: dict[str, Any] = {}
    effect = library()[selected.id]
    for parameter, value, width in zip(selected.place.parameters, certain.coefficients, certain.half, strict=True):
        of_columns = _with_columns(effect.simplified(selected.place), float(value), float(width))
        true, wide = scale.corrected(float(value), of_columns, parameter.unit)
        parameters[parameter.name] = _shown(true, parameter.unit, wide)
    for name, value in selected.shape.items():
        unit = next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "-")
        parameters[name] = _shown(float(value), unit, None)
        half = certain.shape_half
        if name in effect.bounds and half is not None and np.isfinite(half):
            ends = np.clip([value - half, value + half], *effect.bounds[name])
            parameters[name]["ci95"] = [float(end) for end in ends]
    return parameters | _first_moment(selected, certain, scale, model)


def _first_moment(selected: Selected, certain: Intervals, scale: TorqueScale, model: GreyBox) -> dict[str, Any]:
    """Of a mass about the last axis: gravity shows mass times lever, and both alone are less certain."""
    effect = library()[selected.id]
    shape = dict(selected.shape)
    lever = effect.lever(model, selected.place, shape)
    if lever is None:
        return {}

    def moment(fit: Fit) -> float:
        at = shape if fit.shape is None else dict.fromkeys(effect.bounds, fit.shape)
        return float(fit.coefficients[0]) * (effect.lever(model, selected.place, at) or 0.0)

    value = float(certain.coefficients[0]) * lever
    half = certain.half_of(moment)
    if half is None:
        return {}
    true, wide = scale.corrected(value, _with_columns(effect.simplified(selected.place), value, half), "kg m")
    return {FIRST_MOMENT: _shown(true, "kg m", wide)}


def _with_columns(simplification: float, value: float, half: float) -> float:
    """Half width of an interval, with the relative error of the columns themselves."""
    deviation = np.hypot(THRESHOLDS.column_deviation, simplification)
    return float(np.hypot(half, THRESHOLDS.interval_width * deviation * abs(value)))


def _shown(value: float, unit: str, half: float | None) -> dict[str, Any]:
    return {"value": value, "unit": unit, "ci95": None if half is None else [value - half, value + half]}


def clock_term(delay: Delay) -> Reported:
    """The offset or drift that shifts of whole recordings show before the selection."""
    width = THRESHOLDS.interval_width
    offset = _shown(delay.offset_s, "s", width * float(np.hypot(delay.offset_error_s, THRESHOLDS.delay_floor_s)))
    delays = np.array([each for _, each in delay.single])
    agree = float((np.sign(delays) == np.sign(np.median(delays))).mean())
    place = Place("clocks", (0,), (Parameter("power later by", "s"),))
    shape: dict[str, float] = {"seconds": delay.offset_s}
    if delay.drifts:
        rate = _shown(3600 * delay.rate, "s/h", width * 3600 * delay.rate_error)
        shape |= {"seconds_per_hour": 3600 * delay.rate, "origin_s": delay.origin_s}
        parameters = {"power later by, at the start": offset, "and by more each hour": rate}
    else:
        parameters = {"power later by": offset}
    term = Term.of(_clock(drifts=delay.drifts).id, place, shape, np.ones(1), parameters)
    sure = _clock_confidence(delay, delays)
    alternatives = ((_clock(drifts=not delay.drifts).id, round(1 - sure, 6)),)
    return Reported(
        term=term, hypothesis=None, confidence=sure, alternatives=alternatives, start=None, consistency=agree,
        recordings=len(delays), family_confidence=1.0,
    )  # fmt: skip


def _clock_confidence(delay: Delay, delays: Floats) -> float:
    """Probability that the delay drifts, or does not, as said; both are equally likely beforehand.

    By the Bayes factor of a drift of 0 against a normal prior of drifts (Savage and Dickey; Verdinelli and Wasserman
    1995).
    """
    if len(delays) < 3:  # a drift has no error with fewer
        return 0.5
    rate, error = delay.line()
    times = np.array([time for time, _ in delay.single])
    error = float(np.hypot(error, THRESHOLDS.delay_floor_s / max(np.sqrt(((times - times.mean()) ** 2).sum()), 1e-9)))
    wide = float(np.hypot(error, THRESHOLDS.drift_deviation))
    constant = float(np.log(wide / error) - rate**2 * (error**-2.0 - wide**-2.0) / 2)  # two normal densities
    return float(expit(-constant if delay.drifts else constant))


def _clock(*, drifts: bool) -> Effect:
    """The effect of the library for a clock that drifts, or for a constant offset."""
    return next(e for e in library().values() if e.acts_on == "clock" and e.follows_clock == drifts)


def scaled(term: Term, factor: float) -> Term:
    """A term with all coefficients multiplied by a factor."""
    return replace(term, coefficients=term.coefficients * factor)


def described(effect: Reported) -> str:
    """A sentence about the evidence, for report.json."""
    summary = library()[effect.term.id].summary
    agreement = f"{percent(effect.consistency)} of {effect.recordings} recordings"
    if effect.evidence is None:
        return f"{summary}: {agreement} are shifted the same way"
    since = f", since {effect.start}" if effect.start else ""
    return (
        f"{summary} ({effect.term.where}{since}): evidence {effect.evidence:.0f} (twice the log Bayes factor "
        f"against the model without the effect); {agreement} agree"
    )
