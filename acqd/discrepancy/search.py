"""The search for causes: a selection on what the model does not explain, with clocks corrected first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.delay import Delay, beyond_reference, corrected, find_delay
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.discrepancy.selection.accepted import Selection
from acqd.discrepancy.selection.forward_selection import Limits, select
from acqd.models.effects import library
from acqd.models.effects.scene import Scene, segment_scene
from acqd.models.segments import Segment
from acqd.residual.residuals import without_known_effects

Progress = Callable[[str, float], None]
"""Gets the step in progress and the share of it that is complete."""


def search(config: CloseConfig, subject: Subject, progress: Progress) -> tuple[Delay | None, Selection]:
    """The delay between power and motion, if there is one, and the effects that the selection finds after it."""
    delay, rest = unexplained(subject)
    return delay, _select(config, rest, progress)


def unexplained(subject: Subject) -> tuple[Delay | None, Subject]:
    """The delay between power and motion, and the recordings without the power that the model knows, after it."""
    return _without_delay(_without_known_power(subject))


def clock_effects() -> set[str]:
    """Ids of the effects that shift power against motion."""
    return {effect.id for effect in library().values() if effect.acts_on == "clock"}


def _without_known_power(subject: Subject) -> Subject:
    """Without the power of effects that the model holds already."""
    fit = without_known_effects(subject.model, subject.fit)
    return replace(subject, fit=fit, reference=without_known_effects(subject.model, subject.reference))


def _without_delay(subject: Subject) -> tuple[Delay | None, Subject]:
    """Clocks first: while power and motion are shifted, every other effect seems to explain something."""
    if not clock_effects() & subject.chosen:
        return None, subject
    delay = find_delay(_scenes(subject, subject.fit), subject.fit)
    if delay is None:
        return None, subject
    delay = beyond_reference(delay, _scenes(subject, subject.reference), subject.reference)
    if delay is None:
        return None, subject
    return delay, replace(subject, fit=[corrected(s, delay, subject.data.step_s) for s in subject.fit])


def _scenes(subject: Subject, segments: list[Segment]) -> Iterator[Scene]:
    return (segment_scene(subject.carrier, segment) for segment in segments)


def comparison_of(subject: Subject) -> Comparison:
    """The recordings in question, those held out left aside, beside the reference."""
    return Comparison(
        model=subject.carrier, robot=subject.robot, in_question=subject.fit, reference=subject.reference,
        chosen=subject.chosen, withheld=subject.withheld,
        begins=subject.begins,
    )  # fmt: skip


def _select(config: CloseConfig, subject: Subject, progress: Progress) -> Selection:
    what = "computing the columns of all effects"
    progress(what, 0.0)
    setup = set_up(comparison_of(subject), lambda share: progress(what, share))
    return select(setup, Limits(config.max_effects), lambda text: progress(text, 0.0))
