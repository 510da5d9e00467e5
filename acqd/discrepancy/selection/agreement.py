"""Sessions that disagree about an effect: one size for all is then the mean of several causes.

A body that was mounted again another way round is a payload in both sessions, with another centre of mass. The
interaction of effect and session is one more hypothesis, in the same currency as all others.
"""

from __future__ import annotations

import numpy as np

from acqd.dataset.split import log_name
from acqd.discrepancy.selection.accepted import Selected, Selection
from acqd.discrepancy.selection.judging import kinds_of, margin
from acqd.discrepancy.selection.ranking import ranked
from acqd.discrepancy.selection.spread import sessions_of


def disagreeing_sessions(selection: Selection, selected: Selected) -> list[str]:
    """Logs that ask for other parameters of the effect than all logs together, the clearest first.

    Empty with a single log. The difference may be in any of the effect's places: a mass on the axis of the flange may
    be two bodies beside it. It must exceed what wrong columns of the effect leave: a model is wrong in another way in
    another motion.
    """
    design = selection.design
    logs = sessions_of(
        [part for part, open_ in zip(design.parts, selected.gate.open, strict=True) if open_], in_question=True
    )
    same = [each for each in design.columns.candidates if each.id == selected.id]
    if len(logs) < 2 or not same:  # what was detected in the residual has no columns of its own
        return []
    kinds = kinds_of(design.columns.candidates) * len(logs)
    evidence: dict[str, float] = {}
    for log in logs:
        gate = np.array([float(part.in_question and log_name(part.recording) == log) for part in design.parts])
        found = ranked(selection.rows, gate, same)
        if found and found[0].evidence > margin(selection.rows, gate, found[0], [selected.finding], kinds):
            evidence[log] = found[0].evidence
    return sorted(evidence, key=lambda log: -evidence[log])
