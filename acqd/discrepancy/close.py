"""The loop: residual, effect, better model, error before and after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acqd.discrepancy.augment import Added, added, clock_term, errors_of, guarded, scaled
from acqd.discrepancy.delay import Delay, corrected, find_delay
from acqd.discrepancy.design import Design
from acqd.discrepancy.joint_level import JointLevel, joint_level
from acqd.discrepancy.order import CloseOrder
from acqd.discrepancy.prepare import prepare
from acqd.discrepancy.refit import refitted
from acqd.discrepancy.residual import Quality, noise_floor, quality
from acqd.discrepancy.subject import Subject, subject_of
from acqd.discrepancy.trace import Limits, Tracing, trace
from acqd.models.augmented import Augmented
from acqd.models.effects.scene import scene_of
from acqd.models.greybox.model import GreyBox
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.robot.description import Floats

_SURE = 0.5  # of the resampled sets: below, two effects cannot be told apart


@dataclass(slots=True)
class Closed:
    """Everything that the report tells."""

    subject: Subject
    tracing: Tracing
    design: Design
    delay: Delay | None
    base: Predictor
    """The model as it was, or re-fitted beside the effects where the model itself was in question."""
    kept: list[Added]
    refused: list[Added]
    worth: list[float]
    """W RMS on held-out recordings that each kept effect alone takes away."""
    before: Quality
    after: Quality
    errors_before: list[Floats]
    errors_after: list[Floats]
    floor_W: float
    floor_where: str
    reference_rmse: float | None
    """W: of the same model on the recordings that it remembers."""
    joints: JointLevel | None
    verdict: str
    notes: list[str]

    @property
    def model(self) -> Predictor:
        """With the effects."""
        terms = [each.term for each in self.kept]
        return Augmented(self.base, self.subject.carrier, terms) if terms else self.base


def close_loop(order: CloseOrder, progress: Callable[[str, float], None]) -> Closed:
    """Find, add, measure. Raises UserError, InputError."""
    subject = subject_of(order, progress)
    notes = list(subject.notes)
    held_out = subject.held_out
    errors_before = errors_of(subject.model, held_out)
    delay, subject = _without_delay(subject)
    progress("computing what every effect would do", 0.0)
    design, model, gates = prepare(
        subject.carrier, subject.robot, subject.fit, subject.reference, set(subject.chosen), set(subject.withheld),
        lambda share: progress("computing what every effect would do", share),
    )  # fmt: skip
    tracing = trace(design, model, gates, Limits(order.max_effects, order.seed), lambda what: progress(what, 0.0))
    assert tracing.model is not None
    found: list[Added] = [clock_term(delay)] if delay is not None else []
    for named in tracing.found:
        progress(f"how sure: {named.id}", 0.0)
        found.append(added(design, tracing.model, named, order.seed))
    base: Predictor = subject.model
    if subject.question == "structure" and found:
        base, found = refitted(subject, design, tracing, found)
    if not isinstance(getattr(base, "base", base), GreyBox) and subject.question == "structure":
        found = [replace(each, term=scaled(each.term, _share(base, each, subject))) for each in found]
    kept, refused, errors, worth = guarded(base, found, subject.carrier, held_out)
    before, after = quality(errors_before), quality(errors)
    if after.rmse >= before.rmse:  # never worse: then the model stays as it was
        base, refused, kept, worth, after, errors = subject.model, found, [], [], before, errors_before
    floor, where = noise_floor([*subject.fit, *held_out], subject.data.step_s)
    reference_rmse = _rms(errors_of(subject.model, subject.reference)) if subject.reference else None
    joints = joint_level(subject)
    verdict = _verdict(tracing, kept, refused)
    notes += [f"{each.term.id} was found but does not help on held-out recordings: not added" for each in refused]
    return Closed(
        subject, tracing, design, delay, base, kept, refused, worth, before, after, errors_before, errors, floor, where,
        reference_rmse, joints, verdict, notes,
    )  # fmt: skip


def _without_delay(subject: Subject) -> tuple[Delay | None, Subject]:
    """Clocks first: with power and motion apart, everything else looks guilty."""
    if not {"clock_offset", "clock_drift"} & subject.chosen:
        return None, subject
    scenes = [scene_of(subject.carrier, s.q, s.signals, s.start_s, s.channels) for s in subject.fit]
    delay = find_delay(scenes, subject.fit)
    if delay is None:
        return None, subject
    return delay, replace(subject, fit=[corrected(s, delay, subject.data.step_s) for s in subject.fit])


def _share(base: Predictor, each: Added, subject: Subject) -> float:
    """How much of an effect a network has not learned by itself already."""
    alone = Augmented(base, subject.carrier, [each.term])
    power = np.concatenate(
        [a - b for a, b in zip(predictions(alone, subject.fit), predictions(base, subject.fit), strict=True)]
    )
    error = np.concatenate(errors_of(base, subject.fit))
    power = power - power.mean()
    return float(np.clip((power @ error) / max(float(power @ power), 1e-9), 0.0, 1.0))


def _verdict(tracing: Tracing, kept: list[Added], refused: list[Added]) -> str:
    if kept and kept[0].confidence < _SURE:
        return "not_identifiable"
    if kept:
        return "effects_found"
    if tracing.unknown is not None:
        return "unknown_structure"
    return "not_identifiable" if refused else "nothing_left"


def _rms(errors: list[Floats]) -> float:
    return float(np.sqrt((np.concatenate(errors) ** 2).mean()))


def provenance(order: CloseOrder, closed: Closed) -> dict[str, Any]:
    """For the augmented bundle."""
    return {
        "closed_on": str(order.dataset),
        "closed_manifest_sha256": closed.subject.data.digest,
        "closed_fit_recordings": sorted({stretch.recording for stretch in closed.subject.fit}),
    }
