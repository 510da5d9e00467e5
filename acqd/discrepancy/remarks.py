"""What the report says besides the verdict: stages that ran, logs that were not used, effects that were not added."""

from __future__ import annotations

from acqd.discrepancy.joints.logged import side_of
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.guard import Improved
from acqd.discrepancy.search import clock_effects
from acqd.discrepancy.selection.accepted import Tracing
from acqd.discrepancy.selection.agreement import disagreeing_sessions
from acqd.discrepancy.selection.nuisance import level_difference
from acqd.discrepancy.thresholds import THRESHOLDS, Stage
from acqd.models.effects import library


def stages_of(subject: Subject, tracing: Tracing) -> frozenset[Stage]:
    """Stages of the method that ran: the report names their thresholds."""
    stages: set[Stage] = {"recordings", "noise", "selection", "uncertainty", "verdict"}
    if clock_effects() & subject.chosen:
        stages.add("delay")
    if any(library()[name].detected for name in subject.chosen):
        stages.add("detectors")
    if tracing.witness is not None:
        stages.add("joints")
    return frozenset(stages)


def unused_efforts(subject: Subject) -> list[str]:
    """A note if torques or currents were logged and not used."""
    logged = side_of([*subject.reference, *subject.fit]) is not None
    unused = logged and bool(subject.robot.sliding)
    return ["the robot has prismatic joints: logged torques and currents are not used"] if unused else []


def disagreements(tracing: Tracing, improved: Improved) -> list[str]:
    """Notes of reported effects that some logs ask other parameters of than all logs together."""
    reported = {(each.term.id, each.term.where) for each in [*improved.kept, *improved.reported_only]}
    notes = []
    for named in tracing.effects:
        logs = disagreeing_sessions(tracing, named) if (named.id, named.place.where) in reported else []
        if logs:
            notes.append(
                f"{named.id} ({named.place.where}) is not the same in all logs: {', '.join(logs)} would be explained "
                f"clearly better by other parameters; close the loop on single sessions"
            )
    return notes


def drifted_level(tracing: Tracing) -> list[str]:
    """A note of a level that may be drift, because the reference does not show how far standby power drifts."""
    level_W = None if tracing.unknown is not None else level_difference(tracing.regression)  # else part of the unknown
    if level_W is None or abs(level_W) < THRESHOLDS.least_share_of_range * tracing.design.columns.dynamic_range:
        return []
    size = f"a constant {abs(level_W):.2g} W {'more' if level_W > 0 else 'less'} than in the reference"
    short = f"a reference of less than {THRESHOLDS.level_span_s / 60:.0f} min does not show how far that goes"
    return [f"{size} may be drift of the standby power: {short}"]


def not_added(improved: Improved) -> list[str]:
    """Notes of the effects that were found and are not in the model, with the reason."""
    refused = [f"{e.term.id} was found but does not help on held-out recordings: not added" for e in improved.refused]
    unpredictable = "acts at times that neither angles nor signals predict"
    unsure = "cannot be told from its alternatives in these recordings"
    reasons = [
        (e.term.id, unsure if library()[e.term.id].predictable else unpredictable) for e in improved.reported_only
    ]
    return refused + [f"{name} {reason}: reported, not added to the model" for name, reason in reasons]
