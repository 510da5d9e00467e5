"""Pieces of motion as recordings to come: rows of the model's step with the signals that the robot logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from acqd.discrepancy.beforehand import like_reference, with_planned_power
from acqd.experiment.pieces import Piece, motion_of
from acqd.experiment.space import Space
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.motion.controller import BrakeSettings
from acqd.residual.residuals import without_known_effects

NEXT = "next session"
"""Name of the session to come."""


def planned(
    space: Space, pieces: Sequence[Piece], model: Predictor, reference: list[Segment], age_s: float
) -> list[Segment]:
    """A recording per piece, after `age_s` of work, with the power that the model predicts.

    Voltages and temperatures are those of the reference; the tool does nothing. The power that the model knows is
    taken off.
    """
    segments = []
    for piece in pieces:
        motion = motion_of(space, piece.steps, BrakeSettings())
        segment = like_reference(reference, piece.name, motion, model.step_s)
        segments.append(replace(segment, session=NEXT, worked_s=age_s))
    return without_known_effects(model, with_planned_power(model, reference, segments))
