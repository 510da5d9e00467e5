"""Power of a model by cause and by joint: parts that add up to the prediction.

Powers are at the mains: a mechanical watt counts with the gain of the drives, and every part of the drives passes
through the lag of the supply. The lag is linear, so that the sum is the prediction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.augmented import Augmented, Term
from acqd.models.effects import holdable
from acqd.models.effects.cause import Cause
from acqd.models.effects.substeps import RADIUS
from acqd.models.features import continued
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid, residual_features
from acqd.models.metrics import recorded
from acqd.models.predictor import Predictor, Recorded
from acqd.models.segments import Segment

_OF_TERMS = {
    "gravity": Cause.GRAVITY, "inertia": Cause.ACCELERATION, "rotor": Cause.ACCELERATION, "coulomb": Cause.DRY,
    "viscous": Cause.VISCOUS, "copper": Cause.COPPER, "conduction": Cause.DRIVES,
}  # fmt: skip
_OF_SIGNALS = {"brake": Cause.BRAKES, "tool": Cause.TOOL}


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the predicted power."""

    cause: Cause
    name: str
    """Of a term of the grey box, or of an effect with its place."""
    joints: Floats
    """[T, axes + 1] W by joint; the last column is of no joint."""
    term: Term | None = None
    """The effect, of a part that was added to the model."""

    @property
    def power(self) -> Floats:
        """[T] W of all joints."""
        return np.asarray(self.joints.sum(axis=1))


def has_parts(model: Predictor) -> bool:
    """Whether the power of a model has physical parts: that of a network has none."""
    return isinstance(_base(model), GreyBox | Hybrid)


def require_parts(model: Predictor, name: object) -> None:
    """Raise UserError for a model whose power has no physical parts: a network."""
    if not has_parts(model):
        raise UserError(
            f"{name}: a network has no physical parts; train a grey box with a robot description "
            "(acqd train DS --network grey-box) and use that model"
        )


def parts_of(model: Predictor, segment: Segment) -> list[Part]:
    """Parts of the prediction of a segment (see `metrics.predictions`). Raises UserError for a network."""
    return parts_of_recording(model, recorded(model, segment), len(segment.P))


def parts_of_recording(model: Predictor, asked: Recorded, rows: int) -> list[Part]:
    """Parts of `model.recording`, of `rows` rows from `asked.before` on. Raises UserError for a network."""
    require_parts(model, "the model")
    begun = asked.led_in(model.step_s)
    signals = model.known(begun.signals, len(begun.q))
    here = slice(begun.before, begun.before + rows)
    parts = _of_base(_base(model), continued(begun.q, 1), signals)
    if isinstance(model, Augmented):
        parts += _of_effects(model, begun, signals)
    return [Part(each.cause, each.name, each.joints[here], each.term) for each in parts]


def latest_parts(model: Predictor, state: Any, q: Floats, signals: Floats) -> list[Part]:
    """Parts [1, axes + 1] of the power that a `Stream` has predicted last. Raises UserError for a network.

    `state` is the stream's; `q` [T, axes] and `signals` [T, k] are its rows, or as many of the last ones as the lag of
    the supply needs.
    """
    require_parts(model, "the model")
    rows = len(q) - model.radius
    parts = _of_base(_base(model), np.concatenate([q[:1], q[: rows + 1]]), signals[:rows])
    parts = [Part(each.cause, each.name, each.joints[-1:]) for each in parts]
    if isinstance(model, Augmented):
        parts += _named(model, [power[None] for power in model.latest_by_joint(state)])
    return parts


def _base(model: Predictor) -> Predictor:
    return model.base if isinstance(model, Augmented) else model


def added_power(model: Augmented, segment: Segment) -> Floats:
    """[T] W of all added effects, whatever the base of the model is."""
    asked = recorded(model, segment)
    begun = asked.led_in(model.step_s)
    signals = model.known(begun.signals, len(begun.q))
    power = model.effects(continued(begun.q, RADIUS), signals, begun.start_s)
    return power[begun.before : begun.before + len(segment.P)]


def _of_effects(model: Augmented, begun: Recorded, signals: Floats) -> list[Part]:
    if not model.terms:
        return []
    return _named(model, model.effects_by_joint(continued(begun.q, RADIUS), signals, begun.start_s))


def _named(model: Augmented, powers: list[Floats]) -> list[Part]:
    """Parts of the terms, from `powers` [T, axes + 1] W of each."""
    return [
        Part(holdable()[term.id].cause, f"{term.id} ({term.where})", power, term)
        for term, power in zip(model.terms, powers, strict=True)
    ]


def _of_base(base: Predictor, around: Floats, signals: Floats) -> list[Part]:
    """Parts [T, axes + 1] of a grey box or hybrid, of angles [T + 2, axes] and the signals of any effects too."""
    signals = signals[:, : len(base.signals)]
    if isinstance(base, Hybrid):
        network = base.network(residual_features(base.normal, around, base.step_s))
        return [*_of_base(base.grey, around, signals), Part(Cause.UNNAMED, "network", _of_no_joint(network, base.axes))]
    assert isinstance(base, GreyBox)
    parts = [
        Part(_OF_TERMS[name], name, np.pad(power, ((0, 0), (0, 1))))
        for name, power in base.joint_terms(around, signals).items()
    ]
    for name, values, weight in zip(base.signals, signals.T, base.group("signals"), strict=True):
        parts.append(
            Part(_OF_SIGNALS.get(name, Cause.OTHER), f"signal {name}", _of_no_joint(weight * values, base.axes))
        )
    standby = np.full(len(signals), base.group("standby")[0])
    return [Part(Cause.STANDBY, "standby", _of_no_joint(standby, base.axes)), *parts]


def _of_no_joint(power: Floats, axes: int) -> Floats:
    return np.column_stack([np.zeros((len(power), axes)), power])
