"""Joint re-fit: where the model itself lacks an effect, its other parameters have absorbed part of that effect."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.terms import Reported
from acqd.models.augmented import Augmented, Term
from acqd.models.effects import library
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.greybox.model import GreyBox
from acqd.models.predictor import Predictor
from acqd.residual.residuals import without_known_effects


def refitted(subject: Subject, effects: list[Reported], seed: int) -> tuple[Predictor, list[Reported]]:
    """A grey box fitted to the power without the effects; other models stay unchanged.

    An effect whose parameters the grey box had been denied comes back as those parameters.
    """
    if not isinstance(subject.model, GreyBox):
        return subject.model, effects
    effects = [replace(each, restored=bool(subject.withheld & groups_of(each))) for each in effects]
    restored = {group for each in effects if each.restored for group in groups_of(each)} & subject.withheld
    terms = [each.term for each in effects if not each.restored]
    return refitted_to_rest(subject, terms, subject.withheld - restored, seed), effects


def refitted_to_rest(subject: Subject, terms: list[Term], denied: Iterable[str], seed: int) -> Predictor:
    """A grey box fitted to the power without the terms, without the `denied` groups; other models stay unchanged."""
    if not isinstance(subject.model, GreyBox):
        return subject.model
    rest = without_known_effects(Augmented(subject.carrier, subject.carrier, terms), subject.fit)
    fit = fit_grey_box(subject.robot, rest, subject.data.step_s, seed, lambda _: None, tuple(sorted(denied)))
    return fit.model


def groups_of(effect: Reported) -> set[str]:
    """Groups of grey-box parameters that describe an effect."""
    return set(library()[effect.term.id].restores)
