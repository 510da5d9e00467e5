"""The verdict: what may be said after effects were selected, added and guarded."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.guard import Improved
from acqd.discrepancy.repair.terms import Added
from acqd.discrepancy.residual.residuals import errors_of, rms
from acqd.discrepancy.selection.accepted import Tracing, Verdict
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.segments import Segment


def settled(
    subject: Subject, tracing: Tracing, improved: Improved, errors_before: list[Floats]
) -> tuple[Verdict, Improved, list[str]]:
    """The verdict, the model that it permits, and notes.

    Effects are found only if they explain a fair share of the excess over the reference and one family of causes is
    the likeliest; what cannot be identified is not added to a model. Nothing is left only where the error has not
    grown beyond that of the reference.
    """
    errors_of_reference = errors_of(subject.model, subject.reference) if subject.reference else []
    reference_W = rms(errors_of_reference) if errors_of_reference else 0.0
    improved, notes = _without_traces(subject, tracing, improved, reference_W)
    effects = [*improved.kept, *improved.reported_only]
    if effects:
        sure = effects[0].family_confidence >= THRESHOLDS.least_confidence
        if sure and (improved.reported_only or _fair(rms(errors_before), rms(improved.errors), reference_W)):
            return "effects_found", improved, notes
        return "not_identifiable", _nothing_added(subject, improved, errors_before), notes
    if tracing.unknown is not None:
        return "unknown_structure", improved, notes
    if grown(subject.held_out, errors_before, subject.reference, errors_of_reference):
        rows = f"{rms(errors_before):.2f} W RMS, {reference_W:.2f} W in the reference"
        return "not_identifiable", improved, [*notes, f"the residual has grown ({rows}), and no cause is credible"]
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


def _fair(before: float, after: float, reference_W: float) -> bool:
    excess = before**2 - min(reference_W, after) ** 2
    return before**2 - after**2 >= THRESHOLDS.fair_share * excess


def _without_traces(
    subject: Subject, tracing: Tracing, improved: Improved, reference_W: float
) -> tuple[Improved, list[str]]:
    """Without effects at unpredictable times that explain next to nothing: a random walk has switching loads."""
    if not improved.reported_only:
        return improved, []
    errors = errors_of(subject.model, subject.fit)
    rows = sum(len(error) for error in errors)
    excess = max(rms(errors) ** 2 - reference_W**2, 0.0) * rows
    gains = {named.id: named.finding.supported().plain for named in tracing.effects}
    shares = [(each, gains.get(each.term.id, 0.0) / max(excess, 1e-9)) for each in improved.reported_only]
    kept = [each for each, share in shares if share >= THRESHOLDS.fair_share]
    notes = [
        f"{each.term.id} was found, but explains only {max(share, 0.0):.0%} of the residual's excess: not reported"
        for each, share in shares
        if share < THRESHOLDS.fair_share
    ]
    return improved.with_reported(kept), notes


def _nothing_added(subject: Subject, improved: Improved, errors_before: list[Floats]) -> Improved:
    everything: list[Added] = [*improved.kept, *improved.reported_only]
    return Improved(
        base=subject.model, kept=[], reported_only=everything, refused=improved.refused, gains=[], errors=errors_before
    )
