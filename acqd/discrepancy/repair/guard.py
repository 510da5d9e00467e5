"""The repaired model, and the guard: an effect is added only if it reduces the error on held-out recordings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.repair.refit import refitted
from acqd.discrepancy.repair.terms import Added, scaled
from acqd.discrepancy.residual.residuals import errors_of, rms
from acqd.models.augmented import Augmented, Term
from acqd.models.effects import library
from acqd.models.greybox.model import GreyBox
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment


@dataclass(frozen=True, slots=True)
class Improved:
    """A model with its effects, and what became of the others."""

    base: Predictor
    """Unchanged, or fitted again."""
    kept: list[Added]
    reported_only: list[Added]
    """Effects at unpredictable times: the report has them, the model has not."""
    refused: list[Added]
    gains: list[float]
    """W RMS on held-out recordings: increase of the error without a kept effect."""
    errors: list[Floats]
    """[T] W on the held-out segments."""
    correction: Correction | None = None
    """Of an unknown structure."""

    def with_reported(self, effects: list[Added]) -> Improved:
        """With other effects that are only reported."""
        return replace(self, reported_only=effects)

    def model(self, subject: Subject) -> Predictor:
        """The base with all terms."""
        return Augmented.of(self.base, subject.carrier, self.terms)

    @property
    def terms(self) -> list[Term]:
        """Kept effects that are no parameters of the base, and the correction."""
        kept = [each.term for each in self.kept if not each.restored]
        return kept if self.correction is None else [*kept, self.correction.term]

    @property
    def extended(self) -> bool:
        """Whether the model has an effect or a correction that it had not before."""
        return bool(self.kept) or self.correction is not None


def improve(subject: Subject, effects: list[Added], errors_before: list[Floats], seed: int) -> Improved:
    """Add effects; keep those that help on the held-out recordings."""
    if not effects:
        return _unchanged(subject, effects, errors_before)
    base: Predictor = subject.model
    if subject.question == "structure":
        base, effects = refitted(subject, effects, seed)
        if not isinstance(base, GreyBox):
            effects = [
                replace(each, term=scaled(each.term, share_unlearned(base, each.term, subject))) for each in effects
            ]
    restored, terms = [e for e in effects if e.restored], [e for e in effects if not e.restored]
    kept, errors, gains = guarded(base, terms, subject)
    if rms(errors) >= rms(errors_before) or not restored + kept:
        return _unchanged(subject, effects, errors_before)
    keys = {each.key for each in kept}
    rejected = [each for each in terms if each.key not in keys]
    reported_only, refused = _split_predictable(rejected)
    total = rms(errors_before) - rms(errors)
    return Improved(
        base=base, kept=restored + kept, reported_only=reported_only, refused=refused,
        gains=[total] * len(restored) + gains, errors=errors,
    )  # fmt: skip


def _unchanged(subject: Subject, effects: list[Added], errors_before: list[Floats]) -> Improved:
    reported_only, refused = _split_predictable(effects)
    return Improved(
        base=subject.model, kept=[], reported_only=reported_only, refused=refused, gains=[], errors=errors_before
    )


def guarded(base: Predictor, effects: list[Added], subject: Subject) -> tuple[list[Added], list[Floats], list[float]]:
    """Effects that help on the held-out segments, the residuals, and the gain of every kept effect (W RMS).

    Backward elimination: two effects may help only together, so that the most harmful one is removed first.
    """
    kept = list(effects)
    while True:
        errors = _errors_with(base, kept, subject)
        without = [rms(_errors_with(base, [o for o in kept if o.key != each.key], subject)) for each in kept]
        gains = [rmse - rms(errors) for rmse in without]
        if not kept or min(gains) > 0:
            return kept, errors, gains
        kept.pop(int(np.argmin(gains)))


def _errors_with(base: Predictor, effects: list[Added], subject: Subject) -> list[Floats]:
    return errors_of(Augmented.of(base, subject.carrier, [each.term for each in effects]), subject.held_out)


def _split_predictable(effects: list[Added]) -> tuple[list[Added], list[Added]]:
    """Effects at unpredictable times, and the others."""
    unpredictable = [each for each in effects if not library()[each.term.id].predictable]
    return unpredictable, [each for each in effects if library()[each.term.id].predictable]


def share_unlearned(base: Predictor, term: Term, subject: Subject) -> float:
    """Share of a term's power that a network has not learned yet: slope of the residual on that power, 0 to 1."""
    segments: list[Segment] = subject.fit
    with_effect = predictions(Augmented.of(base, subject.carrier, [term]), segments)
    pairs = zip(with_effect, predictions(base, segments), strict=True)
    power = np.concatenate([with_term - without for with_term, without in pairs])
    error = np.concatenate(errors_of(base, segments))
    power = power - power.mean()
    return float(np.clip((power @ error) / max(float(power @ power), 1e-9), 0.0, 1.0))
