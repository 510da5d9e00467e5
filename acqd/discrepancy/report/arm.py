"""The arm in motion: predicted power by cause, and the residual by what the loop has changed in the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.closed import Closed
from acqd.models.augmented import Augmented
from acqd.models.causes import has_parts, parts_of
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.report.arm_view import ArmView, Layer, Motion
from acqd.report.palette import CAUSES, FOUND, PLAIN, REST
from acqd.robot.frames import frames_of

_SHOWN_S = 60.0
_STEP_S = 0.12
"""Between rows of the view: means of the powers."""
_MOST = 3
"""Recordings."""
_SMALLEST_W = 0.05
"""A layer that never has more is left out of the residual; its power goes to what is unexplained."""

_Named = tuple[str, str, Floats]
"""Name, cause, and [T, axes + 1] W."""


def arm_view(closed: Closed) -> ArmView:
    """The held-out recordings whose error the loop changed most, or whose error is largest; a minute of each."""
    subject = closed.subject
    sizes = [
        float((b**2 - a**2 if closed.extended else b**2).mean())
        for b, a in zip(closed.errors_before, closed.errors_after, strict=True)
    ]
    chosen = sorted(range(len(sizes)), key=lambda k: -sizes[k])[:_MOST]
    before, after = subject.model, closed.improved.model(subject)
    motions = [_motion(subject.held_out[k], before, after, subject.data.step_s) for k in chosen]
    label = "" if subject.data.measured == "mains" else f"{subject.data.measured.capitalize()} data. "
    caption = (
        f"{label}First: power of the model after this search, by cause. Then: residual of the model before, split into "
        "what the search has changed in the model and what is unexplained. Powers are at the mains; links are drawn "
        "plain."
    )
    return ArmView(frames_of(subject.robot), motions, caption)


def _motion(segment: Segment, before: Predictor, after: Predictor, step_s: float) -> Motion:
    was, now = _parts(before, segment), _parts(after, segment)
    unexplained = segment.P - np.sum([joints.sum(axis=1) for _, _, joints in now], axis=0)
    every = min(max(1, round(_STEP_S / step_s)), len(segment.P))
    rows = min(len(segment.P), max(every, round(_SHOWN_S / step_s))) // every * every
    first = _busiest(unexplained**2, rows)

    def means(values: Floats) -> Floats:
        """[T, ...] in the rows that are shown."""
        some = values[first : first + rows]
        return np.asarray(some.reshape(-1, every, *some.shape[1:]).mean(axis=1))

    causes = dict.fromkeys(cause for _, cause, _ in now)
    predicted = [
        Layer(cause, CAUSES.get(cause, PLAIN), means(np.sum([joints for _, of, joints in now if of == cause], axis=0)))
        for cause in causes
    ]
    t = np.asarray(step_s * (first + every * np.arange(rows // every) + every // 2), dtype=np.float64)
    q = segment.q[first : first + rows][every // 2 :: every]
    return Motion(segment.recording, t, q, means(segment.P), predicted, _changes(was, now, unexplained, means))


def _changes(
    was: Sequence[_Named], now: Sequence[_Named], unexplained: Floats, means: Callable[[Floats], Floats]
) -> list[Layer]:
    """By which the parts of the model after differ from those of the model before; the last layer is what is left."""
    gained: dict[str, Floats] = {}
    for sign, parts in ((1.0, now), (-1.0, was)):
        for name, _, joints in parts:
            gained[name] = gained.get(name, 0.0) + sign * joints
    left = np.column_stack([np.zeros((len(unexplained), now[0][2].shape[1] - 1)), unexplained])
    layers, colours = [], cycle(FOUND)
    for name, joints in gained.items():
        if np.abs(joints.sum(axis=1)).max() > _SMALLEST_W:
            layers.append(Layer(name, next(colours), means(joints)))
        else:
            left = left + joints
    return [*layers, Layer("unexplained", REST, means(left))]


def _parts(model: Predictor, segment: Segment) -> list[_Named]:
    """Name, cause and [T, axes + 1] W of the parts of a prediction; a network is one part beside its effects."""
    if not has_parts(model):
        return _of_network(model, segment)
    return [(each.name, each.cause.value, each.joints) for each in parts_of(model, segment)]


def _of_network(model: Predictor, segment: Segment) -> list[_Named]:
    base = model.base if isinstance(model, Augmented) else model
    (whole,), (plain,) = predictions(model, [segment]), predictions(base, [segment])

    def of_no_joint(power: Floats) -> Floats:
        return np.column_stack([np.zeros((len(power), model.axes)), power])

    parts = [("model", "model", of_no_joint(plain))]
    if base is not model:
        parts.append(("effects", "effects", of_no_joint(whole - plain)))
    return parts


def _busiest(squares: Floats, width: int) -> int:
    """First of `width` rows with the largest sum."""
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    return int(np.argmax(sums[width:] - sums[:-width]))
