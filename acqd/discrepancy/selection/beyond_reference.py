"""An unnamed law has to show where the reference knows the model: at speeds that the reference has (ADR 54).

In faster motion than any that the model was made from, a base model is wrong in ways that no unchanged session shows:
then a law is as likely a part of the robot that was always there. Effects have names, and a physical form that reaches
beyond the reference; a law has neither.
"""

from __future__ import annotations

import numpy as np

from acqd.discrepancy.regression.gram import Regression
from acqd.discrepancy.selection.accepted import Selection
from acqd.discrepancy.selection.ranking import Rows, ranked


def only_beyond_reference(selection: Selection) -> bool:
    """Whether the unknown structure exceeds its margin only with rows faster than the reference.

    False without a structure, or without a reference.
    """
    unknown, design = selection.unknown, selection.design
    columns = design.columns
    sides = columns.scenes.in_question
    if unknown is None or all(sides):
        return False
    speeds = [np.abs(segment.motion(columns.model.step_s)[1]) for segment in columns.segments]
    highest = np.max([own.max(axis=0) for own, side in zip(speeds, sides, strict=True) if not side], axis=0)
    within = tuple(
        good & (speeds[part.segment][part.own] <= highest).all(axis=1)
        for part, good in zip(design.parts, design.trusted, strict=True)
    )
    if all(np.array_equal(now, before) for now, before in zip(within, design.trusted, strict=True)):
        return False
    slow = design.with_trusted(within)
    rows = Rows(slow, Regression(slow.blocks, selection.regression.columns), selection.rows.learning_rate)
    found = ranked(rows, unknown.gate.open, [unknown.finding.candidate])
    return not found or found[0].evidence <= unknown.margin
