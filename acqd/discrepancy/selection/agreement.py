"""Sessions that disagree about an effect: one size for all is then the mean of several causes.

A body that was mounted again another way round is a payload in both sessions, with another centre of mass. The
interaction of effect and session is one more hypothesis, in the same currency as all others. Where that hypothesis
passes, the sessions have columns of their own: what one size for all leaves is no second effect.
"""

from __future__ import annotations

from acqd.discrepancy.regression.least_squares import Column
from acqd.discrepancy.selection.accepted import Selected
from acqd.discrepancy.selection.judging import kinds_of, margin
from acqd.discrepancy.selection.ranking import Rows, prior_deviations, ranked
from acqd.discrepancy.selection.spread import logs_in_question


def disagreements(rows: Rows, selected: Selected) -> tuple[dict[str, float], list[Column]]:
    """Logs that ask for other parameters of the effect than all logs together, with their evidence, and their columns.

    `rows`: with the columns of all selected effects. Nothing with a single log. The difference may be in any of the
    effect's places: a mass on the axis of the flange may be two bodies beside it. It must exceed what wrong columns of
    the effect leave: a model is wrong in another way in another motion. Logs before an onset may have the effect in
    another size, too.
    """
    design = rows.design
    logs = logs_in_question(design)
    same = [each for each in design.columns.candidates if each.id == selected.id]
    if len(logs) < 2 or not same:  # what was detected in the residual has no columns of its own
        return {}, []
    kinds = kinds_of(design.columns.candidates) * len(logs)
    evidence: dict[str, float] = {}
    columns: list[Column] = []
    for log, gate in logs.items():
        found = ranked(rows, gate, same)
        if not found or found[0].evidence <= margin(rows, gate, found[0], [selected.finding], kinds):
            continue
        evidence[log] = found[0].evidence
        indices = found[0].candidate.indices
        pairs = zip(indices.tolist(), prior_deviations(design, indices).tolist(), strict=True)
        columns += [Column(index, gate, deviation, varies=selected.key) for index, deviation in pairs]
    return evidence, columns
