"""The correction of a model by the law that an unknown structure follows, if that helps on held-out recordings.

Only laws of motion and power can correct a model: what follows the time of day or the past hours is described, because
a prediction knows neither.
"""

from __future__ import annotations

from dataclasses import replace

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.repair.guard import Improved, share_unlearned
from acqd.discrepancy.repair.law_fit import fit_law
from acqd.discrepancy.repair.refit import groups_of, refitted_to_rest
from acqd.discrepancy.repair.terms import scaled
from acqd.discrepancy.repair.torque_scale import torque_scale
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.residual.residuals import about_means, errors_of, explained_share, rms
from acqd.discrepancy.selection.accepted import Tracing
from acqd.discrepancy.selection.hypotheses import unnamed
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.augmented import Augmented, Term
from acqd.models.predictor import Predictor


def corrected(
    subject: Subject, tracing: Tracing, improved: Improved, usual: UsualError, seed: int
) -> tuple[Improved, list[str]]:
    """The model with the law that its error follows, and notes if it is left out.

    Kept effects stay as they are. Like effects, the law must explain a fair share of the held-out error above that of
    the reference (without one, above the noise floor), as it is or about the mean of every minute.
    """
    unknown = tracing.unknown
    if unknown is None:
        return improved, []
    what = unnamed(unknown.finding.candidate.label)
    if unknown.finding.candidate.law_columns is None:
        return improved, [f"{what} cannot be predicted from the motion: the model is not corrected"]
    if not usual.exceeded_by(improved.errors):
        return improved, [f"{what} is in an error that has not grown: the model is not corrected"]
    fitted = fit_law(tracing, unknown, {(each.term.id, each.term.where) for each in improved.kept})
    if fitted is None:
        return improved, [f"{what} has no size beside the model's own parameters: the model is not corrected"]
    scale = torque_scale(subject)
    base, term = _with_law(subject, improved, fitted.term(scale), seed)
    errors = errors_of(Augmented.of(base, subject.carrier, [*improved.terms, term]), subject.held_out)
    share = max(
        explained_share(improved.errors, errors, usual.lowest_W),
        explained_share(about_means(improved.errors), about_means(errors), usual.varying_W),
    )
    gain = rms(improved.errors) - rms(errors)
    if gain <= 0:
        return improved, [f"a correction by {what} does not help on held-out recordings: not added"]
    if share < THRESHOLDS.fair_share:
        return improved, [f"a correction by {what} explains only {share:.0%} of the held-out error: not added"]
    correction = Correction(
        term=term, part=fitted.part, follows=what, along=fitted.along, strength=fitted.strength(scale),
        recordings=fitted.recordings, begins=unknown.gate.start, gain=gain,
    )  # fmt: skip
    better = replace(improved, base=base, correction=correction, errors=errors)
    return replace(better, gains=_gains(subject, better)), []


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


def _gains(subject: Subject, better: Improved) -> list[float]:
    """W RMS by which the held-out error is larger without each kept effect; as before for restored parameters."""
    gains = []
    for each, before in zip(better.kept, better.gains, strict=True):
        others = [term for term in better.terms if term is not each.term]
        without: list[Floats] = errors_of(Augmented.of(better.base, subject.carrier, others), subject.held_out)
        gains.append(before if each.restored else rms(without) - rms(better.errors))
    return gains
