"""A cause has to show where the reference knows the model: at speeds that the reference has (ADR 54).

In faster motion than any that the model was made from, a base model is wrong in ways that no unchanged session shows:
then a cause is as likely a part of the robot that was always there.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.least_squares import Regression
from acqd.discrepancy.selection.ranking import Finding, Rows, ranked


def only_beyond_reference(rows: Rows, gate: Floats, finding: Finding, least: float) -> bool:
    """Whether a finding under a gate [blocks] has the least evidence only with rows faster than the reference.

    `rows`: without the finding. False without a reference.
    """
    design = rows.design
    columns = design.columns
    sides = columns.scenes.in_question
    if all(sides):
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
    found = ranked(
        Rows(slow, Regression(slow.blocks, rows.regression.columns), rows.learning_rate), gate, [finding.candidate]
    )
    return not found or found[0].evidence <= least
