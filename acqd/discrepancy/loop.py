"""The loop: residual, effect, better model, error before and after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from acqd.arrays import Floats
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.joint_torque import JointLevel, joint_level
from acqd.discrepancy.recordings import Subject, subject_of
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.setup import prepare
from acqd.discrepancy.repair.guard import Improved, improve
from acqd.discrepancy.repair.terms import Added, added, clock_term, errors_of, rms, without_known
from acqd.discrepancy.residual.delay import Delay, corrected, find_delay
from acqd.discrepancy.residual.quality import Quality, noise_floor, quality
from acqd.discrepancy.selection.stepwise import Limits, Tracing, trace
from acqd.models.effects.scene import scene_of

ENOUGH_S = 120.0
_SURE = 0.5  # of the resampled sets: below, two effects cannot be told apart


@dataclass(slots=True)
class Closed:
    """Everything that the report tells."""

    subject: Subject
    tracing: Tracing
    design: Design
    improved: Improved
    before: Quality
    after: Quality
    errors_before: list[Floats]
    floor_W: float
    floor_where: str
    reference_rmse: float | None
    """W: of the same model on the recordings that it remembers."""
    joints: JointLevel | None
    verdict: str
    notes: list[str]

    @property
    def kept(self) -> list[Added]:
        """Effects that were added."""
        return self.improved.kept

    @property
    def named(self) -> list[Added]:
        """Effects that were found: added, or told of without."""
        return [*self.improved.kept, *self.improved.reported_only]

    @property
    def errors_after(self) -> list[Floats]:
        """[T] W on the held-out stretches."""
        return self.improved.errors


def close_loop(order: CloseConfig, progress: Callable[[str, float], None]) -> Closed:
    """Find, add, measure. Raises UserError, InputError."""
    subject = subject_of(order, progress)
    notes = list(subject.notes)
    held_out = subject.held_out
    errors_before = errors_of(subject.model, held_out)
    delay, unexplained = _without_delay(_without_known(subject))
    progress("computing what every effect would do", 0.0)
    design, model, gates = prepare(
        subject.carrier,
        subject.robot,
        unexplained.fit,
        unexplained.reference,
        set(subject.chosen),
        set(subject.withheld),
        lambda share: progress("computing what every effect would do", share),
    )
    tracing = trace(design, model, gates, Limits(order.max_effects, order.seed), lambda what: progress(what, 0.0))
    assert tracing.model is not None
    found: list[Added] = [clock_term(delay)] if delay is not None else []
    for named in tracing.found:
        progress(f"how sure: {named.id}", 0.0)
        found.append(added(design, tracing.model, named, order.seed))
    improved = improve(subject, found, errors_before, order.seed)
    floor, where = noise_floor([*subject.fit, *held_out], subject.data.step_s)
    reference_rmse = rms(errors_of(subject.model, subject.reference)) if subject.reference else None
    notes += [
        f"{each.term.id} was found but does not help on held-out recordings: not added" for each in improved.refused
    ]
    notes += [
        f"{each.term.id} acts at moments that no angle or signal foretells: no model can predict it, none was changed"
        for each in improved.reported_only
    ]
    before, after = quality(errors_before), quality(improved.errors)
    return Closed(
        subject, tracing, design, improved, before, after, errors_before, floor, where,
        reference_rmse, joint_level(subject), _verdict(subject, tracing, improved), notes,
    )  # fmt: skip


def _without_known(subject: Subject) -> Subject:
    """Effects that the model has already are taken out of the power: only what is left is looked at."""
    fit, reference = without_known(subject.model, subject.fit), without_known(subject.model, subject.reference)
    return replace(subject, fit=fit, reference=reference)


def _without_delay(subject: Subject) -> tuple[Delay | None, Subject]:
    """Clocks first: with power and motion apart, everything else looks guilty."""
    if not {"clock_offset", "clock_drift"} & subject.chosen:
        return None, subject
    scenes = [scene_of(subject.carrier, s.q, s.signals, s.start_s, s.channels) for s in subject.fit]
    delay = find_delay(scenes, subject.fit)
    if delay is None:
        return None, subject
    return delay, replace(subject, fit=[corrected(s, delay, subject.data.step_s) for s in subject.fit])


def _verdict(subject: Subject, tracing: Tracing, improved: Improved) -> str:
    named = [*improved.kept, *improved.reported_only]
    if named:
        return "effects_found" if named[0].confidence >= _SURE else "not_identifiable"
    if tracing.unknown is not None:
        return "unknown_structure"
    seconds = sum(len(segment.P) for segment in subject.fit) * subject.data.step_s
    # silence of too few rows is no proof that nothing is there
    return "not_identifiable" if improved.refused or seconds < ENOUGH_S else "nothing_left"


def provenance(order: CloseConfig, closed: Closed) -> dict[str, Any]:
    """For the augmented bundle."""
    return {
        "closed_on": str(order.dataset),
        "closed_manifest_sha256": closed.subject.data.digest,
        "closed_fit_recordings": sorted({segment.recording for segment in closed.subject.fit}),
    }
