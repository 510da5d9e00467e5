"""The model with what was found: fitted anew where it was itself in question, and never worse than before."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.refit import refitted
from acqd.discrepancy.repair.terms import Added, errors_of, guarded, rms, scaled
from acqd.models.augmented import Augmented
from acqd.models.effects import library
from acqd.models.greybox.model import GreyBox
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor


@dataclass(frozen=True, slots=True)
class Improved:
    """What came of adding."""

    base: Predictor
    """As it was, or re-fitted."""
    kept: list[Added]
    reported_only: list[Added]
    """Found, but at moments that nothing foretells: the report has them, the model has not."""
    refused: list[Added]
    worth: list[float]
    """W RMS on held-out recordings that each kept effect takes away."""
    errors: list[Floats]
    """[T] W on the held-out stretches."""

    def model(self, subject: Subject) -> Predictor:
        """With the effects as terms."""
        terms = [each.term for each in self.kept if not each.restored]
        return Augmented.of(self.base, subject.carrier, terms)


def improve(subject: Subject, found: list[Added], errors_before: list[Floats], seed: int) -> Improved:
    """Add what was found; keep what helps on the held-out recordings."""
    unchanged = Improved(subject.model, [], *_split_predictable(found), [], errors_before)
    if not found:
        return unchanged
    base: Predictor = subject.model
    if subject.question == "structure":
        base, found = refitted(subject, found, seed)
        if not isinstance(base, GreyBox):
            found = [replace(each, term=scaled(each.term, _share(base, each, subject))) for each in found]
    restored, terms = [e for e in found if e.restored], [e for e in found if not e.restored]
    kept, refused, errors, worth = guarded(base, terms, subject.carrier, subject.held_out)
    if rms(errors) >= rms(errors_before) or not restored + kept:
        reported_only, refused = _split_predictable(found)
        return replace(unchanged, reported_only=reported_only, refused=refused)
    whole = rms(errors_before) - rms(errors)
    reported_only, refused = _split_predictable(refused)
    return Improved(base, restored + kept, reported_only, refused, [whole] * len(restored) + worth, errors)


def _split_predictable(found: list[Added]) -> tuple[list[Added], list[Added]]:
    """Effects that no model could predict, and the others."""
    reported_only = [each for each in found if not library()[each.term.id].predictable]
    return reported_only, [each for each in found if library()[each.term.id].predictable]


def _share(base: Predictor, each: Added, subject: Subject) -> float:
    """How much of an effect a network has not learned by itself already."""
    unit_torque = Augmented.of(base, subject.carrier, [each.term])
    both = zip(predictions(unit_torque, subject.fit), predictions(base, subject.fit), strict=True)
    power = np.concatenate([with_effect - without for with_effect, without in both])
    error = np.concatenate(errors_of(base, subject.fit))
    power = power - power.mean()
    return float(np.clip((power @ error) / max(float(power @ power), 1e-9), 0.0, 1.0))
