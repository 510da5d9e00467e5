"""The repaired model, and the guard: what does not predict recordings that took no part is no finding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.repair.predictive import Predictive
from acqd.discrepancy.repair.refit import refitted
from acqd.discrepancy.repair.terms import Reported, scaled
from acqd.discrepancy.selection.accepted import Hypothesis
from acqd.models.augmented import Augmented, Term
from acqd.models.effects import library
from acqd.models.greybox.model import GreyBox
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.residual.residuals import errors_of, rms


@dataclass(frozen=True, slots=True)
class Improved:
    """A model with its effects, and what became of the others."""

    base: Predictor
    """Unchanged, or fitted again."""
    effects: tuple[Reported, ...]
    """All that were selected, each with its status."""
    errors: list[Floats]
    """[T] W on the held-out segments."""
    correction: Correction | None = None
    """Of an unknown structure."""

    @property
    def kept(self) -> list[Reported]:
        """Effects in the model."""
        return [each for each in self.effects if each.status == "added"]

    @property
    def named(self) -> list[Reported]:
        """Effects that were found: in the model, then those that are only reported."""
        return self.kept + [each for each in self.effects if each.status == "reported"]

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """Selected effects that are no finding, with the reason."""
        rows = [each.as_hypothesis() for each in self.effects if each.status in ("hypothesis", "refused")]
        return [row for row in rows if row is not None]

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


def improve(
    subject: Subject, effects: list[Reported], errors_before: list[Floats], predictive: Predictive, seed: int,
    *, grown: Callable[[list[Floats]], bool],
) -> Improved:  # fmt: skip
    """Add named effects; the guard refuses what does not predict the held-out recordings.

    What predicts them beside a level that varies, and does not reduce the error in W, is reported and not added, if the
    error that the added effects leave has `grown` beyond that of the reference: in a usual error, a density may follow
    what sessions differ by.
    """
    named = [each for each in effects if each.status == "named"]
    if not named:
        return Improved(subject.model, tuple(effects), errors_before)
    base: Predictor = subject.model
    if subject.question == "structure":
        base, named = refitted(subject, named, seed)
        if not isinstance(base, GreyBox):
            named = [replace(each, term=scaled(each.term, share_unlearned(base, each.term, subject))) for each in named]
    errors = _Errors(base, subject)
    restored, terms = [e for e in named if e.restored], [e for e in named if not e.restored]
    predicting = helpful(terms, lambda chosen: predictive.density(errors.of(chosen), places_of(chosen)))
    added = helpful(predicting, lambda chosen: -rms(predictive.without_load(errors.of(chosen))))
    before, now = (rms(predictive.without_load(each)) for each in (errors_before, errors.of(added)))
    if now >= before or not restored + added:
        restored, added, base, after = [], [], subject.model, errors_before
    else:
        after = errors.of(added)
    before, now, rest = rms(errors_before), rms(after), grown(after)
    keys = {each.key for each in restored + added}
    gains = {each.key: rms(errors.of([o for o in added if o.key != each.key])) - now for each in added}
    judged = {
        each.key: replace(each, status="added", gain_W=gains.get(each.key, before - now))
        if each.key in keys
        else _not_added(each, predicts=rest and any(each.key == other.key for other in predicting))
        for each in named
    }
    return Improved(base, tuple(judged.get(each.key, each) for each in effects), after)


def _not_added(effect: Reported, *, predicts: bool) -> Reported:
    if predicts or not library()[effect.term.id].predictable:
        return replace(effect, status="reported")
    return effect.without_name("refused", "a better prediction of recordings that took no part")


def places_of(effects: list[Reported]) -> set[tuple[str, str]]:
    """Ids and places."""
    return {(each.term.id, each.term.where) for each in effects}


def helpful(effects: list[Reported], worth: Callable[[list[Reported]], float]) -> list[Reported]:
    """Effects without which a model is worth less.

    Backward elimination: two effects may help only together, so that the most harmful one is removed first.
    """
    kept = list(effects)
    while kept:
        whole = worth(kept)
        losses = [whole - worth([other for other in kept if other.key != each.key]) for each in kept]
        if min(losses) > 0:
            break
        kept.pop(int(np.argmin(losses)))
    return kept


class _Errors:
    """Errors of a base model with some effects on the held-out segments, each set computed once."""

    def __init__(self, base: Predictor, subject: Subject) -> None:
        self._base, self._subject = base, subject
        self._known: dict[frozenset[str], list[Floats]] = {}

    def of(self, effects: list[Reported]) -> list[Floats]:
        """[T] W per segment."""
        key = frozenset(each.key for each in effects)
        if key not in self._known:
            model = Augmented.of(self._base, self._subject.carrier, [each.term for each in effects])
            self._known[key] = errors_of(model, self._subject.held_out)
        return self._known[key]


def share_unlearned(base: Predictor, term: Term, subject: Subject) -> float:
    """Share of a term's power that a network has not learned yet: slope of the residual on that power, 0 to 1."""
    segments: list[Segment] = subject.fit
    with_effect = predictions(Augmented.of(base, subject.carrier, [term]), segments)
    pairs = zip(with_effect, predictions(base, segments), strict=True)
    power = np.concatenate([with_term - without for with_term, without in pairs])
    error = np.concatenate(errors_of(base, segments))
    power = power - power.mean()
    return float(np.clip((power @ error) / max(float(power @ power), 1e-9), 0.0, 1.0))
