"""The loop: residual, effect, better model, error before and after."""

from __future__ import annotations

from acqd.discrepancy.closed import Closed
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.joints.summary import joint_level
from acqd.discrepancy.recordings import subject_of
from acqd.discrepancy.remarks import disagreements, drifted_level, not_added, stages_of, unused_efforts
from acqd.discrepancy.repair.correcting import corrected
from acqd.discrepancy.repair.guard import improve
from acqd.discrepancy.repair.naming import named_effects, without_unproven
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.residual.quality import quality
from acqd.discrepancy.residual.residuals import errors_of
from acqd.discrepancy.search import Progress, search
from acqd.discrepancy.verdict import settled
from acqd.models.noise_floor import noise_floor


def close_loop(config: CloseConfig, progress: Progress) -> Closed:
    """Find effects, add them, measure the error. Raises UserError, InputError."""
    subject = subject_of(config, progress)
    errors_before = errors_of(subject.model, subject.held_out)
    floor_W, floor_source = noise_floor([*subject.fit, *subject.held_out], subject.data.step_s)
    usual = UsualError.of(subject, floor_W)
    delay, tracing = search(config, subject, progress)
    effects, doubts = named_effects(subject, tracing, delay, config.seed, progress)
    if not usual.exceeded_by(errors_before):
        effects, unproven = without_unproven(effects, tracing)
        doubts = [*doubts, *unproven]
    sure = [each for each in effects if each.sure]
    improved = improve(subject, sure, errors_before, config.seed)
    improved = improved.with_reported([*improved.reported_only, *(each for each in effects if not each.sure)])
    verdict, improved, remarks = settled(subject, tracing, improved, errors_before, usual)
    if tracing.unknown is not None and verdict in ("unknown_structure", "effects_found"):
        progress("correcting the model", 0.0)
        improved, reasons = corrected(subject, tracing, improved, usual, config.seed)
        remarks = [*remarks, *reasons]
    return Closed(
        subject=subject, tracing=tracing, improved=improved, before=quality(errors_before),
        after=quality(improved.errors), errors_before=errors_before, floor_W=floor_W, floor_source=floor_source,
        reference_rmse=usual.reference_rms,
        joints=joint_level(tracing.witness, subject.chosen), verdict=verdict, stages=stages_of(subject, tracing),
        notes=[
            *subject.notes, *unused_efforts(subject), *doubts, *drifted_level(tracing), *remarks, *not_added(improved),
            *disagreements(tracing, improved),
        ],
    )  # fmt: skip
