"""The set of causes in words and for machines."""

from __future__ import annotations

import math
from typing import Any

from acqd.discrepancy.causes.belief import MISSED, NOTHING, OUTSIDE, Belief, given_lead, shipped, with_member
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.repair.terms import Reported
from acqd.models.effects import library
from acqd.report.digits import percent

_SHOWN = 4
LEAST = 0.01
"""Less likely labels are neither on the tile nor in the probabilities of report.json."""


def believed(closed: Closed) -> Belief | None:
    """Of the largest cause; None where nothing acts, and without what the calibration had.

    That is a reference, all effects, and power of the time of the motion. What acts in held-out recordings alone leaves
    no evidence, and the scale of evidence says that nothing acts: an error there that has grown denies that.
    """
    standing = closed.selection.standing
    if standing is None or not closed.subject.reference or closed.subject.chosen != frozenset(library()):
        return None
    if closed.mistimed:
        return None
    belief, lead = shipped().believed(standing), leading(closed)
    if lead is None and closed.still_grown and next(iter(belief.probabilities)) == NOTHING:
        return None
    if lead is None:  # no cause was found: the verdict excludes nothing only where a structure is proven
        return belief if closed.verdict == "unknown_structure" else with_member(belief, NOTHING)
    rivals: dict[str, float] = {}
    for name, share in lead.alternatives:
        label = name if name in library() else OUTSIDE
        rivals[label] = max(rivals.get(label, 0.0), share)
    belief = given_lead(belief, lead.term.id, lead.confidence, rivals)
    return with_member(belief, OUTSIDE) if closed.largely_unexplained else belief


def leading(closed: Closed) -> Reported | None:
    """The effect with the largest evidence, named or not; None where every effect may be nothing.

    A shift of whole recordings was corrected before any evidence was computed.
    """
    effects = [each for each in closed.improved.effects if each.status != "refused"]
    return max(effects, key=lambda each: math.inf if each.evidence is None else each.evidence, default=None)


def text(closed: Closed, belief: Belief) -> str:
    """The set in a sentence; what explains little is not called the largest cause, however sure its name is."""
    if leading(closed) is None or not closed.largely_unexplained:
        return sentence(belief, by_confidence=leading(closed) is not None)
    known = [f"{name_of(each)} ({percent(belief.probabilities[each])})" for each in belief.members if each != OUTSIDE]
    part = "explains less than half of what the squared error has grown by"
    return f"the largest cause may be {name_of(OUTSIDE)}: {' or '.join(known)} {part}"


def sentence(belief: Belief, *, by_confidence: bool = False) -> str:
    """The set, the likeliest first. Only the calibrated set is counted in simulated cases."""
    members = [f"{name_of(label)} ({percent(belief.probabilities[label])})" for label in belief.members]
    if by_confidence and len(members) == 1:
        return f"the largest cause: {members[0]}"
    share = percent(1 - MISSED)
    sure = f"with {share} confidence" if by_confidence else f"in {share} of simulated cases"
    if len(members) == 1:
        return f"the largest cause, right {sure}: {members[0]}"
    more = len(members) - _SHOWN
    listed = ", ".join(members[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
    return f"the largest cause is one of these {sure}: {listed}"


def as_json(closed: Closed) -> dict[str, Any] | None:
    """For report.json."""
    belief, standing = believed(closed), closed.selection.standing
    if belief is None or standing is None:
        return None
    lead = leading(closed) is not None
    return {
        "set": list(belief.members),
        "holds": 1 - MISSED,
        "text": text(closed, belief),
        "probabilities": {label: share for label, share in belief.probabilities.items() if share >= LEAST},
        "calibrated_on": shipped().source,
        "follows": "confidence" if lead else "standing",
        "scores": standing.as_json(),
    }


def name_of(label: str) -> str:
    """A label in words."""
    return {OUTSIDE: "something outside the library", NOTHING: "nothing"}.get(label, label)
