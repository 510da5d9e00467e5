"""Where the model itself lacks something, its other parameters have taken over part of it: all are fitted anew."""

from __future__ import annotations

from dataclasses import replace

from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.terms import Added
from acqd.models.augmented import Augmented
from acqd.models.effects.substeps import RADIUS
from acqd.models.features import padded
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import DENIABLE
from acqd.models.metrics import signals_of
from acqd.models.predictor import Predictor


def refitted(subject: Subject, found: list[Added], seed: int) -> tuple[Predictor, list[Added]]:
    """A grey box fitted to what the effects leave; other models stay as they are.

    An effect that a grey box has parameters for, and was denied, comes back as those parameters.
    """
    if not isinstance(subject.model, GreyBox):
        return subject.model, found
    restored = {group for each in found for group in DENIABLE.get(each.term.id, ())} & subject.withheld
    found = [replace(e, restored=bool(restored & set(DENIABLE.get(e.term.id, ())))) for e in found]
    beside = Augmented(subject.carrier, subject.carrier, [each.term for each in found if not each.restored])
    left = []
    for segment in subject.fit:
        known = beside.known(signals_of(beside, segment), len(segment.P))
        effects = beside.effects(padded(segment.q, RADIUS), known, segment.start_s)
        left.append(replace(segment, P=segment.P - effects))
    denied = tuple(sorted(subject.withheld - restored))
    fit = fit_grey_box(subject.robot, left, subject.data.step_s, seed, lambda _: None, denied)
    return fit.model, found
