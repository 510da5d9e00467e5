"""Residuals of a model, measured minus predicted power, on recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.models.augmented import Augmented
from acqd.models.effects.substeps import RADIUS
from acqd.models.metrics import predictions, signals_of
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.residual.thresholds import NOISE


def errors_of(model: Predictor, segments: list[Segment]) -> list[Floats]:
    """[T] W per segment: measured minus predicted, see `residuals`."""
    return residuals(predictions(model, segments), segments)


def residuals(predicted: list[Floats], segments: list[Segment]) -> list[Floats]:
    """[T] W per segment: measured minus predicted.

    The motion outside a log that starts or ends in motion is unknown. Its outermost rows take the residual of their
    neighbours.
    """
    errors = [segment.P - prediction for segment, prediction in zip(segments, predicted, strict=True)]
    for own, segment in zip(errors, segments, strict=True):
        _, before, after = segment.extended()
        if before < RADIUS:
            own[:RADIUS] = own[RADIUS]
        if after < RADIUS:
            own[-RADIUS:] = own[-RADIUS - 1]
    return errors


def without_known_effects(model: Predictor, segments: list[Segment]) -> list[Segment]:
    """Segments without the power of the effects that the model holds already."""
    if not isinstance(model, Augmented):
        return segments
    known = [model.known(signals_of(model, s), len(s.P)) for s in segments]
    return [
        replace(s, P=s.P - model.effects(s.around(RADIUS), signals, s.start_s))
        for s, signals in zip(segments, known, strict=True)
    ]


def rms(errors: list[Floats]) -> float:
    """Root mean square of all rows, W."""
    return float(np.sqrt((np.concatenate(errors) ** 2).mean()))


def explained_share(before: list[Floats], after: list[Floats], lowest_W: float) -> float:
    """Share of the squared error above the lowest that can be reached."""
    was, remains = rms(before), rms(after)
    return (was**2 - remains**2) / max(was**2 - min(lowest_W, remains) ** 2, 1e-12)


def about_means(errors: list[Floats]) -> list[Floats]:
    """[T] W per block of at most a minute, about its mean: without the drift of the standby power."""
    blocks = [block for each in errors for block in np.array_split(each, max(1, round(len(each) / NOISE.block_rows)))]
    return [block - block.mean() for block in blocks]
