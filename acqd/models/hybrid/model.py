"""A grey box plus a small network that predicts the residual of the grey box."""

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
    """Perceptron with one hidden tanh layer. Inputs: normalised q, qd, qdd; output: W."""

    W: Floats
    """[hidden, 3 axes]."""
    b: Floats
    """[hidden]."""
    out: Floats
    """[hidden] W."""

    def __call__(self, features: Floats) -> Floats:
        """Power [T] W of features [T, 3 axes]."""
        return np.asarray(np.tanh(features @ self.W.T + self.b) @ self.out)


def residual_features(normal: Normalisation, q: Floats, step_s: float) -> Floats:
    """Normalised q, qd, qdd [T, 3 axes] of angles [T + 2, axes]."""
    qd, qdd = derivatives(q, step_s)
    return np.concatenate([normal.inputs(0, q[1:-1]), normal.inputs(1, qd), normal.inputs(2, qdd)], axis=1)


class Hybrid(Predictor):
    """Sum of a grey box (`grey`) and the network for its residual."""

    radius = 1

    def __init__(self, grey: GreyBox, network: Perceptron, normal: Normalisation) -> None:
        self.grey, self.network, self.normal = grey, network, normal
        self.axes, self.step_s, self.signals = grey.axes, grey.step_s, grey.signals

    def usual_signals(self) -> Floats:
        """The grey box's usual signals."""
        return self.grey.usual_signals()

    def run(self, q: Floats, signals: Floats) -> Floats:
        """Grey box plus network."""
        return self.grey.run(q, signals) + self.network(residual_features(self.normal, q, self.step_s))

    def start(self) -> Any:
        """The grey box's state; the network has none."""
        return self.grey.start()

    def step(self, state: Any, window: Floats, signals: Floats) -> float:
        """Grey box plus network, for one row."""
        correction = self.network(residual_features(self.normal, window, self.step_s))
        return self.grey.step(state, window, signals) + float(correction[0])
