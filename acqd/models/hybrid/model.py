"""Power as physics says, plus what a small network has seen it get wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.models.features import derivatives
from acqd.models.greybox.model import GreyBox
from acqd.models.normalisation import Normalisation
from acqd.models.predictor import Predictor


@dataclass(frozen=True, slots=True)
class Perceptron:
    """One hidden layer of tanh; input normalised q, qd, qdd, output W."""

    W: Floats
    """[hidden, 3 axes]."""
    b: Floats
    """[hidden]."""
    out: Floats
    """[hidden] W."""

    def __call__(self, features: Floats) -> Floats:
        """[T] W for features [T, 3 axes]."""
        return np.asarray(np.tanh(features @ self.W.T + self.b) @ self.out)


def residual_features(normal: Normalisation, q: Floats, step_s: float) -> Floats:
    """[T, 3 axes] of angles [T + 2, axes]."""
    qd, qdd = derivatives(q, step_s)
    return np.concatenate([normal.inputs(0, q[1:-1]), normal.inputs(1, qd), normal.inputs(2, qdd)], axis=1)


class Hybrid(Predictor):
    """See the module; the grey box's terms stay addressable."""

    radius = 1

    def __init__(self, grey: GreyBox, network: Perceptron, normal: Normalisation) -> None:
        self.grey, self.network, self.normal = grey, network, normal
        self.axes, self.step_s, self.signals = grey.axes, grey.step_s, grey.signals

    def usual_signals(self) -> Floats:
        """See Predictor."""
        return self.grey.usual_signals()

    def run(self, q: Floats, signals: Floats) -> Floats:
        """See Predictor."""
        return self.grey.run(q, signals) + self.network(residual_features(self.normal, q, self.step_s))

    def start(self) -> Any:
        """See Predictor."""
        return self.grey.start()

    def step(self, state: Any, window: Floats, signals: Floats) -> float:
        """See Predictor."""
        rest = self.network(residual_features(self.normal, window, self.step_s))
        return self.grey.step(state, window, signals) + float(rest[0])
