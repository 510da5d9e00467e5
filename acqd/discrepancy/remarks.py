"""What the report says besides the verdict: stages that ran, logs that were not used, effects that were not added."""

from __future__ import annotations

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.guard import Improved
from acqd.discrepancy.repair.terms import Reported
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.search import clock_effects
from acqd.discrepancy.selection.accepted import Selection, power_in_question
from acqd.discrepancy.selection.session_columns import LEVEL
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.report.digits import percent
from acqd.residual.logged_torque import side_of
from acqd.residual.residuals import explained_share, rms
from acqd.threshold import Stage

MOST = 0.5
"""Share from which on something explains more than all the rest together."""


def stages_of(subject: Subject, selection: Selection) -> frozenset[Stage]:
    """Stages of the method that ran: the report names their thresholds."""
    stages: set[Stage] = {"recordings", "noise", "selection", "uncertainty", "verdict"}
    if clock_effects() & subject.chosen:
        stages.add("delay")
    if any(library()[name].detected for name in subject.chosen):
        stages.add("detectors")
    if selection.witness is not None:
        stages.add("joints")
    return frozenset(stages)


def unused_efforts(subject: Subject) -> list[str]:
    """A note if torques or currents were logged and not used."""
    logged = side_of([*subject.reference, *subject.fit]) is not None
    unused = logged and bool(subject.robot.sliding)
    return ["the robot has prismatic joints: logged torques and currents are not used"] if unused else []


def differing_logs(selection: Selection, improved: Improved) -> list[str]:
    """Notes of reported effects that some logs ask other parameters of than all logs together."""
    named = {(each.term.id, each.term.where) for each in improved.named}
    notes = []
    for selected in selection.effects:
        logs = selected.disagreeing
        if logs and (selected.id, selected.place.where) in named:
            notes.append(
                f"{selected.id} ({selected.place.where}) is not the same in all logs: {', '.join(logs)} would be "
                f"explained clearly better by other parameters; close the loop on single sessions"
            )
    return notes


def largely_unexplained(
    selection: Selection,
    improved: Improved,
    before: list[Floats],
    after: list[Floats],
    usual: UsualError,
    *,
    grown: bool,
) -> list[str]:
    """A note where the names explain less than half of what the error has grown by, and the rest is no usual error.

    `before`, `after` [T] W: errors of the held-out segments without what the reference explains (ADR 110). `grown`:
    whether the errors that remain are larger than those of the reference. Effects whose times nothing predicts
    explain nothing of recordings that took no part; their power counts as in the recordings of the search.
    """
    if usual.reference_rms is None or not grown or not improved.named:
        return []
    most = max(rms(before) ** 2 - usual.lowest_W**2, 1e-12)
    share = explained_share(before, after, usual.lowest_W)
    share += sum(_timed_squares(selection, each) for each in improved.named) / most
    if share >= MOST:
        return []
    sizes = f"{rms(after):.2f} W remain on held-out recordings, {usual.lowest_W:.2f} W in the reference"
    explained = f"what has a name explains {percent(max(share, 0.0))} of what the squared error has grown by"
    return [f"{explained}: {sizes}; the largest cause may be something else"]


def _timed_squares(selection: Selection, effect: Reported) -> float:
    """W^2: mean square of the power of a named effect whose times nothing predicts; 0 of other effects."""
    if library()[effect.term.id].predictable:
        return 0.0
    powers = [
        power
        for each in selection.effects
        if (each.id, each.place.where) == (effect.term.id, effect.term.where)
        for power in power_in_question(selection.design, each.finding, each.gate.open)
    ]
    return rms(powers) ** 2 if powers else 0.0


def drifted_level(selection: Selection) -> list[str]:
    """A note of a level that may be drift, because unchanged sessions differ by as much."""
    if selection.unknown is not None:  # the level is part of the unknown
        return []
    values = zip(selection.regression.columns, selection.regression.solve().tolist(), strict=True)
    level_W = sum(value for column, value in values if column.owner == LEVEL)
    if abs(level_W) < THRESHOLDS.least_share_of_range * selection.design.columns.dynamic_range:
        return []
    size = f"a constant {abs(level_W):.2g} W {'more' if level_W > 0 else 'less'} than in the reference"
    return [f"{size} may be drift of the standby power: unchanged sessions differ by as much"]


def usual_differences(selection: Selection) -> list[str]:
    """A note of what would lead if unchanged sessions did not differ by as much."""
    names = [f"{each.id} ({each.where})" if each.id else each.name for each in selection.usual]
    return [
        f"unchanged sessions of the reference differ as much by {name}: effects are judged beside such a difference"
        for name in names
    ]


def common_load(selection: Selection) -> list[str]:
    """A note of a load that both sides have, and what it may hide."""
    load = selection.design.columns.load
    if load is None:
        return []
    return [
        f"a load of {load.size_W:.2g} W switches on this meter in the reference, too, and is taken out: a new load of "
        "about that size would not be seen"
    ]


def not_added(improved: Improved) -> list[str]:
    """Notes of the effects that were selected and are not in the model, with the reason."""
    notes = []
    for each in improved.effects:
        what = f"{each.term.id} ({each.term.where})"
        if each.status in ("hypothesis", "refused"):
            notes.append(f"{what} is no finding; missing: {each.missing}")
        elif each.status == "reported":
            predictable = library()[each.term.id].predictable
            reason = "does not reduce the held-out error in W" if predictable else "acts at times that nothing predicts"
            notes.append(f"{what} {reason}: reported, not added to the model")
    return notes
