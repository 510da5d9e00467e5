"""Selected effects get their names, unless an unnamed alternative is likelier: with confidence and alternatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.terms import Added, added, clock_term
from acqd.discrepancy.repair.torque_scale import torque_scale
from acqd.discrepancy.residual.delay import Delay
from acqd.discrepancy.selection.accepted import Tracing


def named_effects(
    subject: Subject, tracing: Tracing, delay: Delay | None, seed: int, progress: Callable[[str, float], None]
) -> tuple[list[Added], list[str]]:
    """The clock term of `delay` and the selected effects, as the report shows them, and notes of those left out."""
    effects: list[Added] = [clock_term(delay)] if delay is not None else []
    scale = torque_scale(subject)
    for named in tracing.effects:
        progress(f"confidence of {named.id}", 0.0)
        effects.append(added(tracing, named, scale, seed))
    return without_doubtful(effects, tracing)


def without_unproven(effects: list[Added], tracing: Tracing) -> tuple[list[Added], list[str]]:
    """For an error that has not grown beyond the reference's: effects with a size for certain, and notes of the others.

    Of recordings that the model predicts as well as before, some fit a small effect better by chance.
    """
    unproven = [each for each in effects if each.may_be_nothing]
    needed = ["an error that has grown, or a size whose 95 % interval excludes zero"]
    tracing.hypotheses = [*(replace(each.as_hypothesis(), missing=needed) for each in unproven), *tracing.hypotheses]
    notes = [
        f"{each.term.id} ({each.term.where}) may be zero, in an error that has not grown: no finding"
        for each in unproven
    ]
    return [each for each in effects if not each.may_be_nothing], notes


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
