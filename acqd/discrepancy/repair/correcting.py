"""The correction of a model by the law that an unknown structure follows, if that helps on held-out recordings.

Only laws of motion and power can correct a model: what follows the time of day or the past hours is described, because
a prediction knows neither.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.repair.guard import Improved, places_of, share_unlearned
from acqd.discrepancy.repair.law_fit import LawFit, fit_law
from acqd.discrepancy.repair.predictive import Predictive
from acqd.discrepancy.repair.refit import groups_of, refitted_to_rest
from acqd.discrepancy.repair.terms import Reported, scaled
from acqd.discrepancy.repair.torque_scale import TorqueScale, torque_scale
from acqd.discrepancy.selection.accepted import Selection, unnamed
from acqd.discrepancy.thresholds.chance import by_chance
from acqd.models.augmented import Augmented, Term
from acqd.models.predictor import Predictor
from acqd.residual.residuals import errors_of, rms


@dataclass(frozen=True, slots=True)
class Trial:
    """A model with the law that its error follows."""

    base: Predictor
    term: Term
    errors: list[Floats]
    """[T] W on the held-out segments."""
    fitted: LawFit
    scale: TorqueScale
    gain_W: float
    """RMS by which the law reduces the error on held-out recordings."""
    log_gain: float
    """Twice the log predictive density of the held-out recordings with the law, less that without."""

    @property
    def predicts(self) -> bool:
        """Whether held-out recordings alone show the law, beyond chance: the base model's uncertainty included."""
        return self.log_gain > by_chance(1)


def tried(
    subject: Subject, selection: Selection, improved: Improved, predictive: Predictive, seed: int
) -> Trial | None:
    """The law of an unknown structure beside kept effects, which stay as they are.

    None without such a law, where no model of motion can follow the law, or where the law has no size of its own.
    """
    unknown = selection.unknown
    if unknown is None or unknown.finding.candidate.law_columns is None:
        return None
    kept = places_of(improved.kept)
    fitted = fit_law(selection, unknown, kept)
    if fitted is None:
        return None
    scale = torque_scale(subject)
    base, term = _with_law(subject, improved, fitted.term(scale), seed)
    errors = errors_of(Augmented.of(base, subject.carrier, [*improved.terms, term]), subject.held_out)
    log_gain = predictive.density(errors, kept) - predictive.density(improved.errors, kept)
    return Trial(base, term, errors, fitted, scale, rms(improved.errors) - rms(errors), log_gain)


def corrected(
    subject: Subject, selection: Selection, improved: Improved, trial: Trial | None, *, grown: bool
) -> tuple[Improved, list[str]]:
    """The model with the law that its error follows, and notes if the law is left out.

    `grown`: whether the error is larger than those of the reference. Like effects, the law must predict the held-out
    recordings better, and reduce the error in W.
    """
    unknown = selection.unknown
    if unknown is None:
        return improved, []
    what = unnamed(unknown.finding.candidate.label)
    if unknown.finding.candidate.law_columns is None:
        return improved, [f"{what} cannot be predicted from the motion: the model is not corrected"]
    if trial is None:
        return improved, [f"{what} has no size beside the model's own parameters: the model is not corrected"]
    if not trial.predicts and not grown:
        return improved, [f"{what} is in an error that has not grown: the model is not corrected"]
    if trial.gain_W <= 0 or trial.log_gain <= 0:
        return improved, [f"a correction by {what} does not help on held-out recordings: not added"]
    correction = Correction(
        term=trial.term, part=trial.fitted.part, follows=what, along=trial.fitted.along,
        strength=trial.fitted.strength(trial.scale), recordings=trial.fitted.recordings, begins=unknown.gate.start,
        gain=trial.gain_W,
    )  # fmt: skip
    better = replace(improved, base=trial.base, correction=correction, errors=trial.errors)
    return replace(better, effects=_gains(subject, better)), []


def _with_law(subject: Subject, improved: Improved, term: Term, seed: int) -> tuple[Predictor, Term]:
    """The base model and the law's term: where the model itself is in question, it has absorbed part of the law.

    A grey box is fitted again; a network keeps what it has learned, and the law what it has not.
    """
    if subject.question == "change":
        return improved.base, term
    restored = {group for each in improved.kept if each.restored for group in groups_of(each)}
    base = refitted_to_rest(subject, [*improved.terms, term], subject.withheld - restored, seed)
    if base is subject.model:
        term = scaled(term, share_unlearned(improved.model(subject), term, subject))
    return base, term


def _gains(subject: Subject, better: Improved) -> tuple[Reported, ...]:
    """The effects with their gains beside the correction; as before for restored parameters."""
    effects = []
    for each in better.effects:
        if each.status != "added" or each.restored:
            effects.append(each)
            continue
        others = [term for term in better.terms if term is not each.term]
        without: list[Floats] = errors_of(Augmented.of(better.base, subject.carrier, others), subject.held_out)
        effects.append(replace(each, gain_W=rms(without) - rms(better.errors)))
    return tuple(effects)
