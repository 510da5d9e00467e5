"""The verdict: what may be said after effects were selected, named and added."""

from __future__ import annotations

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correcting import Trial
from acqd.discrepancy.repair.guard import Improved
from acqd.discrepancy.repair.predictive import Predictive
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.selection.accepted import Selection, Verdict
from acqd.discrepancy.selection.beyond_reference import only_beyond_reference
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.residual.residuals import rms


def settled(
    subject: Subject,
    selection: Selection,
    improved: Improved,
    errors_before: list[Floats],
    predictive: Predictive,
    usual: UsualError,
    trial: Trial | None,
) -> tuple[Verdict, list[str]]:
    """The verdict, and notes about it.

    `errors_before` [T] W of the held-out segments are compared without what the reference explains (ADR 110).

    An effect with a name is found. A structure is unknown if its law predicts recordings that took no part, with a
    smaller error in W, too, or in an error that has grown: what sessions differ by predicts pieces of the same session.
    Nothing is left where no hypothesis passed, the error has not grown, and the recordings are long enough to prove an
    absence. A law stands in the place of effects without a name: it is judged without these.
    """
    if improved.named:
        return "effects_found", []
    errors = predictive.of_change(errors_before)
    grown = usual.exceeded_by(subject.held_out, errors)
    beyond = "" if predictive.beside is None else " beyond what the reference explains"
    sizes = f"{rms(errors):.2f} W RMS{beyond}, {usual.lowest_W:.2f} W in the reference"
    if selection.unknown is not None:
        unknown = selection.unknown
        if only_beyond_reference(selection.unexplained, unknown.gate.open, unknown.finding, unknown.margin):
            faster = "what follows an unnamed cause shows only in faster motion than the reference has"
            return "not_identifiable", [f"{faster}: record a reference at these speeds"]
        if grown or (trial is not None and trial.predicts and trial.gain_W > 0):
            return "unknown_structure", []
        return "not_identifiable", [f"what follows an unnamed cause is in an error that has not grown ({sizes})"]
    if improved.hypotheses:
        return "not_identifiable", []
    if usual.reference and grown:
        laws = [each.name for each in selection.usual if not each.id]
        differ = "; ".join(f"unchanged sessions differ by {each}, too" for each in laws)
        return "not_identifiable", [
            f"the error of the model has grown ({sizes}), and no cause is credible" + (f": {differ}" if differ else "")
        ]
    short = subject.fit_s < THRESHOLDS.enough_s
    return ("not_identifiable" if short else "nothing_left"), []
