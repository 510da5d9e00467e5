"""The loop: residual, effect, better model, error before and after."""

from __future__ import annotations

from dataclasses import replace

from acqd.arrays import Floats
from acqd.discrepancy.ability.ability import Ability
from acqd.discrepancy.another_time import another_time
from acqd.discrepancy.averaging import with_like_means
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.joints.summary import joint_level
from acqd.discrepancy.recordings import subject_of
from acqd.discrepancy.remarks import (
    common_load,
    differing_logs,
    drifted_level,
    largely_unexplained,
    not_added,
    stages_of,
    unused_efforts,
    usual_differences,
)
from acqd.discrepancy.repair.correcting import corrected, tried
from acqd.discrepancy.repair.guard import improve
from acqd.discrepancy.repair.naming import named_effects
from acqd.discrepancy.repair.predictive import Predictive
from acqd.discrepancy.repair.torque_scale import scale_notes
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.search import Progress, search
from acqd.discrepancy.strength import Strength
from acqd.discrepancy.verdict import settled
from acqd.memory import release_freed
from acqd.models.noise_floor import noise_floor
from acqd.residual.quality import quality
from acqd.residual.residuals import errors_of


def close_loop(config: CloseConfig, progress: Progress) -> Closed:
    """Find effects, add them, measure the error. Raises UserError, InputError."""
    progress = _releasing(progress)
    subject = subject_of(config, progress)
    mistimed = another_time(subject)
    subject, of_meters = with_like_means(subject)
    errors_before = errors_of(subject.model, subject.held_out)
    floor_W, floor_source = noise_floor([*subject.fit, *subject.held_out], subject.data.step_s)
    usual = UsualError.of(subject, floor_W)
    delay, selection = search(config, subject, progress)
    effects = named_effects(subject, selection, delay, progress)
    if mistimed:  # every effect explains a part of such an error
        effects = [each.without_name("refused", "power of the time of the motion") for each in effects]
    doubts = [each.doubt for each in effects if each.doubt is not None]
    if doubts and selection.unknown is None:
        selection = replace(selection, unknown=doubts[0])
    progress("predicting held-out recordings", 0.0)
    predictive = Predictive.of(selection, subject)
    progress("judging by held-out recordings", 0.0)

    def grown(errors: list[Floats]) -> bool:
        return usual.exceeded_by(subject.held_out, predictive.of_change(errors))

    improved = improve(subject, effects, errors_before, predictive, config.seed, grown=grown)
    trial = tried(subject, selection, improved, predictive, config.seed)
    verdict, remarks = settled(subject, selection, improved, errors_before, predictive, usual, trial)
    if mistimed:
        verdict, remarks = "not_identifiable", [mistimed]
    if selection.unknown is not None and verdict in ("unknown_structure", "effects_found"):
        progress("correcting the model", 0.0)
        improved, reasons = corrected(subject, selection, improved, trial, grown=grown(improved.errors))
        remarks = [*remarks, *reasons]
    after = quality(improved.errors)
    if after.rmse < floor_W:  # no model can be better than the noise: brakes and supplies act at rest, too
        floor_W, floor_source = after.rmse, "of the residual, which is smaller than what the power varies by at rest"
    still_grown = grown(improved.errors)
    unexplained = largely_unexplained(
        selection, improved, predictive.of_change(errors_before), predictive.of_change(improved.errors), usual,
        grown=still_grown,
    )  # fmt: skip
    warnings = [
        *of_meters,
        *unexplained,
        *differing_logs(selection, improved),
        *common_load(selection),
        *drifted_level(selection),
        *usual_differences(selection),
    ]
    progress("what these recordings can tell", 0.0)
    ability = Ability.of(selection.unexplained, selection.design.columns.in_question)
    strengths = {each.key: Strength.of(selection, each) for each in selection.effects}
    return Closed(
        ability=ability, subject=subject, selection=selection.found, strengths=strengths,
        improved=improved, before=quality(errors_before),
        after=after, errors_before=errors_before, floor_W=floor_W, floor_source=floor_source,
        reference_rmse=usual.reference_rms, mistimed=bool(mistimed),
        joints=joint_level(selection.witness, subject.chosen), verdict=verdict, stages=stages_of(subject, selection),
        notes=[
            *subject.notes, *unused_efforts(subject), *warnings, *not_added(improved),
            *(scale_notes(subject) if effects else []), *remarks,
        ],
        warnings=warnings, largely_unexplained=bool(unexplained), still_grown=still_grown,
    )  # fmt: skip


def _releasing(progress: Progress) -> Progress:
    """Gives memory back between the stages: one leaves hundreds of MB behind in hours of recordings."""
    now = ""

    def report(stage: str, share: float) -> None:
        nonlocal now
        if stage != now:
            release_freed()
            now = stage
        progress(stage, share)

    return report
