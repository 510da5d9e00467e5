"""The verdict: what may be said after effects were selected, added and guarded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.guard import Improved
from acqd.discrepancy.repair.terms import Added
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.residual.residuals import about_means, errors_of, explained_share, rms
from acqd.discrepancy.selection.accepted import Tracing, Verdict
from acqd.discrepancy.selection.hypotheses import Hypothesis
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment


def settled(
    subject: Subject, tracing: Tracing, improved: Improved, errors_before: list[Floats], usual: UsualError
) -> tuple[Verdict, Improved, list[str]]:
    """The verdict, the model that it permits, and notes.

    Effects are found only with enough confidence, and if they explain a fair share of the excess over
    the reference (without one, over the noise floor). A structure is unknown only in a residual above that of the
    reference, where the model misses as much. Nothing is left only where the error has not grown beyond that of the
    reference.
    """
    lowest_W = usual.lowest_W
    improved, notes = _without_traces(subject, tracing, improved, lowest_W)
    improved, unlikely = _without_unlikely(tracing, improved)
    notes += unlikely
    if improved.kept or improved.reported_only:
        share = explained_share(errors_before, improved.errors, lowest_W)
        # standby power drifts over minutes; beside such a drift, an effect of some seconds explains little
        share = max(share, explained_share(about_means(errors_before), about_means(improved.errors), usual.varying_W))
        share = max(share, explained_share(*_where_acting(errors_before, improved.errors), lowest_W))
        if not any(library()[each.term.id].predictable for each in improved.kept):
            # their mean power is added: what they explain shows where their times are known
            share = max([share, *_shares_in_fit(subject, tracing, subject.model, improved.kept, lowest_W)])
        if not improved.kept or share >= THRESHOLDS.fair_share:
            return "effects_found", improved, notes
        names = ", ".join(f"{e.term.id} ({e.term.where})" for e in [*improved.kept, *improved.reported_only])
        remark = f"{names} explain only {max(share, 0.0):.0%} of the squared error above {lowest_W:.2f} W: not added"
        if tracing.unknown is not None:
            return "unknown_structure", _without_effects(subject, improved, errors_before), [*notes, remark]
        tracing.hypotheses = [*_unexplaining(improved, share), *tracing.hypotheses]
        return "not_identifiable", _without_effects(subject, improved, errors_before), [*notes, remark]
    if unlikely and tracing.unknown is None:
        return "not_identifiable", improved, notes
    sizes = f"{rms(errors_before):.2f} W RMS, {lowest_W:.2f} W in the reference"
    if tracing.unknown is not None and not usual.exceeded_by(errors_before):
        remark = f"what follows an unnamed cause is in an error that has not grown ({sizes}): no finding"
        return "not_identifiable", improved, [*notes, remark]
    if tracing.unknown is not None:
        return "unknown_structure", improved, notes
    if grown(subject.held_out, errors_before, subject.reference, usual.reference):
        return (
            "not_identifiable",
            improved,
            [*notes, f"the error of the model has grown ({sizes}), and no cause is credible"],
        )
    # too few rows without an effect do not prove its absence
    few = subject.fit_s < THRESHOLDS.enough_s
    return "not_identifiable" if improved.refused or few else "nothing_left", improved, notes


def grown(segments: list[Segment], errors: list[Floats], reference: list[Segment], before: list[Floats]) -> bool:
    """Whether the median error of recordings lies clearly above the errors of nearly all reference recordings."""
    if not reference:
        return False
    usual = float(np.quantile(_by_recording(reference, before), THRESHOLDS.grown_quantile))
    return float(np.median(_by_recording(segments, errors))) > THRESHOLDS.grown_factor * usual


def _by_recording(segments: list[Segment], errors: list[Floats]) -> Floats:
    """[recordings] W RMS."""
    names = sorted({segment.recording for segment in segments})
    pairs = list(zip(segments, errors, strict=True))
    return np.array([rms([error for segment, error in pairs if segment.recording == name]) for name in names])


def _where_acting(errors_before: list[Floats], errors: list[Floats]) -> tuple[list[Floats], list[Floats]]:
    """Both errors in the rows in which the added effects act: the surge of a brake lasts for a few of them."""
    before, after = np.concatenate(errors_before), np.concatenate(errors)
    power = np.abs(before - after)
    acting = power >= THRESHOLDS.acting_share * power.max()
    return [before[acting]], [after[acting]]


def _without_traces(
    subject: Subject, tracing: Tracing, improved: Improved, lowest_W: float
) -> tuple[Improved, list[str]]:
    """Without effects that explain next to nothing of what the added ones leave: a random walk has switching loads."""
    if not improved.reported_only:
        return improved, []
    known = _shares_in_fit(subject, tracing, improved.model(subject), improved.reported_only, lowest_W)
    shares = list(zip(improved.reported_only, known, strict=True))
    kept = [each for each, share in shares if share >= THRESHOLDS.fair_share]
    notes = [
        f"{each.term.id} was found, but explains only {max(share, 0.0):.0%} of the residual's excess: not reported"
        for each, share in shares
        if share < THRESHOLDS.fair_share
    ]
    return improved.with_reported(kept), notes


def _shares_in_fit(
    subject: Subject, tracing: Tracing, model: Predictor, effects: list[Added], lowest_W: float
) -> list[float]:
    """Share of the excess over `lowest_W` in the errors of `model` that each effect explains, at the times it acts."""
    errors = errors_of(model, subject.fit)
    rows = sum(len(error) for error in errors)
    excess = max(rms(errors) ** 2 - lowest_W**2, 0.0) * rows
    gains = {(named.id, named.place.where): named.finding.supported().plain.total for named in tracing.effects}
    return [gains.get((each.term.id, each.term.where), 0.0) / max(excess, 1e-9) for each in effects]


def _without_unlikely(tracing: Tracing, improved: Improved) -> tuple[Improved, list[str]]:
    """Without effects of too little confidence: they become hypotheses, with a note."""
    unlikely = [each for each in improved.reported_only if not each.sure]
    tracing.hypotheses = [*(each.as_hypothesis() for each in unlikely), *tracing.hypotheses]
    notes = [
        f"{each.term.id} ({each.term.where}) has a confidence of {each.family_confidence:.0%}, less than "
        f"{THRESHOLDS.least_confidence:.0%}: no finding"
        for each in unlikely
    ]
    return improved.with_reported([each for each in improved.reported_only if each.sure]), notes


def _unexplaining(improved: Improved, share: float) -> list[Hypothesis]:
    """Effects that explain less than a fair share of the residual, as hypotheses."""
    needed = f"{THRESHOLDS.fair_share:.0%} of the residual's excess (all effects explain {max(share, 0.0):.0%})"
    effects: list[Added] = [*improved.kept, *improved.reported_only]
    return [replace(each.as_hypothesis(), missing=[needed]) for each in effects if each.evidence is not None]


def _without_effects(subject: Subject, improved: Improved, errors_before: list[Floats]) -> Improved:
    return Improved(
        base=subject.model, kept=[], reported_only=[], refused=improved.refused, gains=[], errors=errors_before
    )
