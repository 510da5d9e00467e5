"""The search for a correction: coefficients, size and likeness of the law that an unknown structure follows.

Only laws of motion and power can correct a model: what follows the time of day or the past hours is described, because
a prediction knows neither.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Regression
from acqd.discrepancy.regression.torque_alternatives import LawColumns
from acqd.discrepancy.repair.correction import SIZE, Correction
from acqd.discrepancy.repair.guard import Improved, share_unlearned
from acqd.discrepancy.repair.refit import refitted_to_rest
from acqd.discrepancy.repair.terms import scaled
from acqd.discrepancy.repair.torque_scale import TorqueScale, torque_scale
from acqd.discrepancy.residual.residuals import errors_of, rms
from acqd.discrepancy.selection.accepted import Tracing, Unknown
from acqd.discrepancy.selection.hypotheses import unnamed
from acqd.discrepancy.selection.ranking import Finding, rank_pooled
from acqd.discrepancy.selection.shape_fit import at_secant_slope, columns_of
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.augmented import Augmented, Term
from acqd.models.effects.laws.law import Quantity
from acqd.models.effects.places import Parameter, Place
from acqd.models.effects.scene import Scene
from acqd.models.greybox.parameters import SLIDING_UNITS

_QUANTILE = 0.95
"""Share of the rows that stay below the size of a law: single rows of a sudden stop say little."""
_SPRING_SHARE = 0.8
"""Share of a torque's variance along the angle that a straight line explains, at least."""


def corrected(subject: Subject, tracing: Tracing, improved: Improved, seed: int) -> tuple[Improved, list[str]]:
    """The model with the law that its error follows, if that helps on the held-out recordings; notes if not.

    Effects that are part of the improved model stay beside the law.
    """
    unknown = tracing.unknown
    if unknown is None:
        return improved, []
    what = unnamed(unknown.finding.candidate.label)
    if unknown.finding.candidate.law is None:
        return improved, [f"{what} cannot be predicted from the motion: the model is not corrected"]
    fitted = _fitted(tracing, unknown, {(each.term.id, each.term.where) for each in improved.kept})
    if fitted is None:
        return improved, [f"{what} has no size beside the model's own parameters: the model is not corrected"]
    scale = torque_scale(subject)
    term = _term(scale, unknown, *fitted)
    base, terms = improved.base, [*improved.terms, term]
    if subject.question == "structure" and not improved.kept:
        base = refitted_to_rest(subject, terms, subject.withheld, seed)
        if base is subject.model:
            terms = [scaled(term, share_unlearned(base, term, subject))]
    errors = errors_of(Augmented.of(base, subject.carrier, terms), subject.held_out)
    gain = rms(improved.errors) - rms(errors)
    if gain <= 0:
        return improved, [f"a correction by {what} does not help on held-out recordings: not added"]
    law = unknown.finding.candidate.law
    along, strength = _seen(tracing.design, law, term)
    strength = strength * scale.corrected(1.0, 0.0, _unit(tracing.design, law))[0]
    correction = Correction(terms[-1], law, what, along, strength, _likeness(law, along, strength), gain)
    return replace(improved, base=base, correction=correction, errors=errors), []


def _fitted(
    tracing: Tracing, unknown: Unknown, kept: set[tuple[str, str]]
) -> tuple[Design, Regression, Finding] | None:
    """The law's coefficients beside the kept effects (id, place), at the secant slope; None where it does not act."""
    regression = tracing.regression
    for named in tracing.effects:
        if (named.id, named.place.where) not in kept:
            regression = regression.without(named.key)
    candidate, gate = unknown.finding.candidate, unknown.gate.open
    law = candidate.law
    assert law is not None
    design = replace(tracing.design, witness=None)
    columns = columns_of(design, law.law, _place(tracing.design, law), gate)
    shape = law.law.shape_of(design.columns.motion, law.joint)
    design, places = design.with_columns(columns(shape))
    own = replace(candidate, places=places)
    design, found = at_secant_slope(design, regression, gate, own, columns, shape)
    return None if found is None else (design, regression.on(design.blocks), found)


def _place(design: Design, law: LawColumns) -> Place:
    unit = _unit(design, law)
    where = f"joint {law.joint}" if law.joint else "robot"
    return Place(where, law.columns, tuple(Parameter(f"c{k + 1}", unit) for k in range(len(law.columns))))


def _unit(design: Design, law: LawColumns) -> str:
    unit = law.law.sized_in
    return SLIDING_UNITS.get(unit, unit) if law.joint - 1 in design.columns.model.layout.sliding else unit


def _term(scale: TorqueScale, unknown: Unknown, design: Design, regression: Regression, found: Finding) -> Term:
    """With the size and its interval (delete-one-recording jackknife)."""
    law, gate = found.candidate.law, unknown.gate
    assert law is not None
    shape = law.law.shape_of(design.columns.motion, law.joint)
    open_ = [part for part, own in zip(design.parts, gate.open, strict=True) if own]
    if gate.start is not None:
        shape["begin_s"] = min(part.start_s for part in open_)
    place = _place(design, law)
    term = Term.of(law.law.id, place, shape, found.coefficients, {})
    size = _size(design, law, term)
    left = []
    for name in sorted({part.recording for part in open_}):
        weights = np.array([float(not part.in_question or part.recording != name) for part in design.parts])
        without = rank_pooled(design, regression, gate.open, [found.candidate], weights)
        left += [_size(design, law, replace(term, coefficients=each.coefficients)) for each in without]
    half = None
    if len(left) >= THRESHOLDS.jackknife_fewest:
        spread = float(np.sqrt((len(left) - 1) * np.var(left)))
        half = float(student.ppf(0.975, len(left) - 1)) * spread
    unit = _unit(design, law)
    value, wide = scale.corrected(size, half or 0.0, unit)
    interval = None if half is None else [max(value - wide, 0.0), value + wide]
    return replace(term, parameters={SIZE: {"value": value, "unit": unit, "ci95": interval}})


def _size(design: Design, law: LawColumns, term: Term) -> float:
    """Strength that 95 % of the rows in question stay below, in the model's units."""
    return float(np.quantile(np.abs(_seen(design, law, term)[1]), _QUANTILE))


def _seen(design: Design, law: LawColumns, term: Term) -> tuple[Quantity, Floats]:
    """What the law depends on and how strong the law is there, over all recordings in question."""
    scenes = [scene for scene, own in zip(design.columns.scenes, design.columns.scenes.in_question, strict=True) if own]
    quantities = [law.law.along(scene, term.shape) for scene in scenes]
    strength = np.concatenate([_strength(scene, law, term) for scene in scenes])
    first = quantities[0]
    return replace(first, values=np.concatenate([each.values for each in quantities])), strength


def _strength(scene: Scene, law: LawColumns, term: Term) -> Floats:
    """[N] Nm at the law's joint (of the whole robot: at the joint with the largest), or W."""
    columns = list(term.columns)
    if law.law.acts_on != "torque":
        return np.asarray(law.law.at(scene, term.shape)[:, columns] @ term.coefficients)
    joints = [law.joint - 1] if law.joint else range(scene.axes)
    torques = [law.law.at(scene.unit_torque(joint), term.shape)[:, columns] @ term.coefficients for joint in joints]
    return np.asarray(torques[int(np.argmax([np.abs(each).max() for each in torques]))])


def _likeness(law: LawColumns, along: Quantity, strength: Floats) -> str:
    """A torque that is proportional to the angle is a spring."""
    if law.law.acts_on != "torque" or along.name != f"angle of joint {law.joint}":
        return ""
    slope, _ = np.polyfit(along.values, strength, 1)
    share = np.corrcoef(along.values, strength)[0, 1] ** 2
    unit = "Nm" if along.unit == "rad" else "N"
    return f"a spring of {abs(slope):.2g} {unit}/{along.unit}" if share > _SPRING_SHARE else ""
