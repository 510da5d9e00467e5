"""Pieces of motion as recordings to come: rows of the model's step with the signals that the robot logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acqd.discrepancy.beforehand import with_planned_power
from acqd.experiment.pieces import Piece, motion_of
from acqd.experiment.space import Space
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.motion.controller import RATE, BrakeSettings
from acqd.residual.residuals import without_known_effects

NEXT = "next session"
"""Name of the session to come."""


def planned(
    space: Space, pieces: Sequence[Piece], model: Predictor, reference: list[Segment], age_s: float
) -> list[Segment]:
    """A recording per piece, `age_s` after the start of the session, with the power that the model predicts.

    Voltages and temperatures are those of the reference; the tool does nothing. The power that the model knows is
    taken off.
    """
    like = reference[0]
    segments = []
    for piece in pieces:
        motion = motion_of(space, piece.steps, BrakeSettings())
        rows = np.arange(round(motion.seconds / model.step_s) - 1)
        at = np.minimum((rows * model.step_s * RATE).astype(int), len(motion) - 1)
        q = motion.q[at]
        known = {"brake": motion.brake_open[at] * 1.0, "tool": np.zeros(len(at))}
        signals = {name: known[name] for name in like.signals if name in known}
        segments.append(
            replace(
                like, recording=piece.name, source=piece.name, q=q, P=np.zeros(len(q)), tau=None, signals=signals,
                channels=_channels(reference, len(q)), before=None, after=None, content=piece.name, session=NEXT,
            )
        )  # fmt: skip
    whole = with_planned_power(model, reference, segments)
    return without_known_effects(model, [replace(each, start_s=each.start_s + age_s) for each in whole])


def _channels(reference: list[Segment], rows: int) -> dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    """Medians of the voltages and temperatures of the reference; currents of motors belong to another motion."""
    channels = {}
    for name, values in reference[0].channels.items():
        if name == "current" or not all(name in segment.channels for segment in reference):
            continue
        usual = np.nanmedian(np.concatenate([segment.channels[name] for segment in reference]), axis=0)
        channels[name] = np.tile(usual, (rows, *[1] * (values.ndim - 1)))
    return channels
