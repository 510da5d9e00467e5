"""The loop: residual, effect, better model, error before and after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from acqd.arrays import Floats
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.joints.columns import side_of
from acqd.discrepancy.joints.summary import JointLevel, joint_level
from acqd.discrepancy.recordings import Subject, subject_of
from acqd.discrepancy.regression.setup import Question, set_up
from acqd.discrepancy.repair.guard import Improved, improve
from acqd.discrepancy.repair.terms import Added, added, clock_term
from acqd.discrepancy.repair.torque_scale import torque_scale
from acqd.discrepancy.residual.delay import Delay, corrected, find_delay
from acqd.discrepancy.residual.quality import Quality, quality
from acqd.discrepancy.residual.residuals import errors_of, rms, without_known_effects
from acqd.discrepancy.selection.accepted import Tracing, Verdict
from acqd.discrepancy.selection.stepwise import Limits, trace
from acqd.discrepancy.thresholds import Stage
from acqd.discrepancy.verdict import settled
from acqd.models.effects import library
from acqd.models.effects.scene import segment_scene
from acqd.models.noise_floor import noise_floor

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Closed:
    """Everything that the report shows."""

    subject: Subject
    tracing: Tracing
    improved: Improved
    before: Quality
    after: Quality
    errors_before: list[Floats]
    """[T] W on the held-out segments."""
    floor_W: float
    floor_source: str
    """Where the noise floor was measured."""
    reference_rmse: float | None
    """W: error of the same model on the reference recordings."""
    joints: JointLevel | None
    verdict: Verdict
    stages: frozenset[Stage]
    """Stages that ran."""
    notes: list[str]

    @property
    def kept(self) -> list[Added]:
        """Effects that were added."""
        return self.improved.kept

    @property
    def named(self) -> list[Added]:
        """Effects that were found: added, or reported only."""
        return [*self.improved.kept, *self.improved.reported_only]

    @property
    def errors_after(self) -> list[Floats]:
        """[T] W on the held-out segments."""
        return self.improved.errors


def close_loop(config: CloseConfig, progress: Progress) -> Closed:
    """Find effects, add them, measure the error. Raises UserError, InputError."""
    subject = subject_of(config, progress)
    errors_before = errors_of(subject.model, subject.held_out)
    delay, unexplained = _without_delay(_without_known(subject))
    tracing = _select(config, unexplained, progress)
    effects: list[Added] = [clock_term(delay)] if delay is not None else []
    scale = torque_scale(subject)
    for named in tracing.effects:
        progress(f"confidence of {named.id}", 0.0)
        effects.append(added(tracing, named, scale, config.seed))
    effects, doubts = without_doubtful(effects, tracing)
    sure = [each for each in effects if each.sure]
    improved = improve(subject, sure, errors_before, config.seed)
    improved = improved.with_reported([*improved.reported_only, *(each for each in effects if not each.sure)])
    floor_W, floor_source = noise_floor([*subject.fit, *subject.held_out], subject.data.step_s)
    verdict, improved, remarks = settled(subject, tracing, improved, errors_before, floor_W)
    return Closed(
        subject=subject, tracing=tracing, improved=improved, before=quality(errors_before),
        after=quality(improved.errors), errors_before=errors_before, floor_W=floor_W, floor_source=floor_source,
        reference_rmse=rms(errors_of(subject.model, subject.reference)) if subject.reference else None,
        joints=joint_level(tracing.witness, subject.chosen), verdict=verdict, stages=_stages(subject, tracing),
        notes=[*subject.notes, *_unused_efforts(subject), *doubts, *remarks, *_notes(improved)],
    )  # fmt: skip


def _select(config: CloseConfig, subject: Subject, progress: Progress) -> Tracing:
    what = "computing the columns of all effects"
    progress(what, 0.0)
    question = Question(
        model=subject.carrier, robot=subject.robot, in_question=subject.fit, reference=subject.reference,
        chosen=subject.chosen, withheld=subject.withheld,
    )  # fmt: skip
    setup = set_up(question, lambda share: progress(what, share))
    return trace(setup, Limits(config.max_effects, config.seed), lambda text: progress(text, 0.0))


def without_doubtful(effects: list[Added], tracing: Tracing) -> tuple[list[Added], list[str]]:
    """Effects that no unnamed alternative outdoes in most resampled recordings, and notes of the others.

    Such an alternative is what the recordings show: an unknown structure.
    """
    doubtful = [each for each in effects if each.doubt is not None]
    if doubtful and tracing.unknown is None:
        tracing.unknown = doubtful[0].doubt
    tracing.hypotheses = [*(each.as_hypothesis() for each in doubtful), *tracing.hypotheses]
    notes = [
        f"{each.term.id} ({each.term.where}) explains less than what has no name, with {each.confidence:.0%} confidence"
        for each in doubtful
    ]
    return [each for each in effects if each.doubt is None], notes


def _without_known(subject: Subject) -> Subject:
    """Without the power of effects that the model holds already."""
    fit = without_known_effects(subject.model, subject.fit)
    return replace(subject, fit=fit, reference=without_known_effects(subject.model, subject.reference))


def _without_delay(subject: Subject) -> tuple[Delay | None, Subject]:
    """Clocks first: while power and motion are shifted, every other effect seems to explain something."""
    if not _clocks() & subject.chosen:
        return None, subject
    scenes = [segment_scene(subject.carrier, s) for s in subject.fit]
    delay = find_delay(scenes, subject.fit)
    if delay is None:
        return None, subject
    return delay, replace(subject, fit=[corrected(s, delay, subject.data.step_s) for s in subject.fit])


def _clocks() -> set[str]:
    return {effect.id for effect in library().values() if effect.acts_on == "clock"}


def _stages(subject: Subject, tracing: Tracing) -> frozenset[Stage]:
    stages: set[Stage] = {"recordings", "noise", "selection", "uncertainty", "verdict"}
    if _clocks() & subject.chosen:
        stages.add("delay")
    if any(library()[name].detected for name in subject.chosen):
        stages.add("detectors")
    if tracing.witness is not None:
        stages.add("joints")
    return frozenset(stages)


def _unused_efforts(subject: Subject) -> list[str]:
    logged = side_of([*subject.reference, *subject.fit]) is not None
    unused = logged and bool(subject.robot.sliding)
    return ["the robot has prismatic joints: logged torques and currents are not used"] if unused else []


def _notes(improved: Improved) -> list[str]:
    refused = [f"{e.term.id} was found but does not help on held-out recordings: not added" for e in improved.refused]
    unpredictable = "acts at times that neither angles nor signals predict"
    unsure = "cannot be told from its alternatives in these recordings"
    reasons = [
        (e.term.id, unpredictable if e.sure and not library()[e.term.id].predictable else unsure)
        for e in improved.reported_only
    ]
    return refused + [f"{name} {reason}: reported, not added to the model" for name, reason in reasons]
