"""Hybrids in and out of bundles: the grey box is fitted first, then the network on what it leaves over."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import minimize

from acqd.arrays import Floats
from acqd.models.bundle.bundle import Arrays
from acqd.models.config import Made, Progress, TrainConfig
from acqd.models.features import padded
from acqd.models.greybox.bundle_io import arrays_of, describe, fitted, restore
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid, Perceptron, residual_features
from acqd.models.metrics import predictions
from acqd.models.normalisation import Normalisation

if TYPE_CHECKING:
    from acqd.models.segments import Dataset, Segment

HIDDEN = 12
_WEIGHT_DECAY = 1e-4
_ROUNDS, _STEPS_A_ROUND = 30, 10
_MOST_ROWS = 150_000
_LEAST_LOOKS = 4  # validation recordings below which no gain can be told from luck


def make_hybrid(order: TrainConfig, data: Dataset, progress: Progress) -> Made:
    """Fit both."""
    fit = fitted(order, data, progress)
    training, validation = data.part("train", order.kinds), data.part("validation", order.kinds)
    normal = Normalisation.fitted(training, data.step_s)
    network, gain = _fit_rest(fit.model, normal, training, validation, order.seed, progress)
    model = Hybrid(fit.model, network, normal)
    metadata = describe(fit) | {
        "architecture": {
            "hidden": HIDDEN,
            "learnables": int(sum(each.size for each in (network.W, network.b, network.out))),
        },
        "normalisation": normal.as_json(),
        "validation_gain": gain,
    }
    arrays = arrays_of(fit.model) | {"rest_W": network.W, "rest_b": network.b, "rest_out": network.out}
    return Made("hybrid", model, metadata, arrays, "Gauss-Newton, L-BFGS")


def restore_hybrid(metadata: dict[str, Any], arrays: Arrays) -> Hybrid:
    """Back from a bundle."""
    network = Perceptron(arrays["rest_W"], arrays["rest_b"], arrays["rest_out"])
    return Hybrid(restore(metadata, arrays), network, Normalisation.from_json(metadata["normalisation"]))


def _fit_rest(
    grey: GreyBox,
    normal: Normalisation,
    training: list[Segment],
    validation: list[Segment],
    seed: int,
    progress: Progress,
) -> tuple[Perceptron, float]:
    """The network of the round that does best on validation, and the share of MSE that it takes away there.

    When no round helps credibly on validation, the network stays silent.
    """
    random = np.random.default_rng(seed)
    X, y = _rows(grey, normal, training)
    if len(y) > _MOST_ROWS:
        kept = random.choice(len(y), _MOST_ROWS, replace=False)
        X, y = X[kept], y[kept]
    X_look, y_look = _rows(grey, normal, validation)
    inputs = X.shape[1]
    scale = max(float(y.std()), 1e-9)
    theta = np.concatenate([random.normal(0, 1 / np.sqrt(inputs), HIDDEN * inputs), np.zeros(2 * HIDDEN)])
    theta[-HIDDEN:] = random.normal(0, 0.1, HIDDEN)
    silent = float((y_look**2).mean())
    nothing = _unpack(np.zeros_like(theta), inputs, 0.0)
    best, best_loss = nothing, silent
    for number in range(_ROUNDS):
        done = minimize(
            _loss, theta, (X, y / scale), method="L-BFGS-B", jac=True, options={"maxiter": _STEPS_A_ROUND, "maxcor": 20}
        )
        theta = done.x
        network = _unpack(theta, inputs, scale)
        loss = float(((y_look - network(X_look)) ** 2).mean())
        if loss < best_loss:
            best, best_loss = network, loss
        progress("fitting the rest", (number + 1) / _ROUNDS, float("nan"))
    if not _helps(best, grey, normal, validation):
        return nothing, 0.0
    return best, 1 - best_loss / silent


def _helps(network: Perceptron, grey: GreyBox, normal: Normalisation, validation: list[Segment]) -> bool:
    """Whether the gain is more than two standard errors over recordings: the best of thirty rounds is lucky."""
    by_recording: dict[str, list[Segment]] = {}
    for segment in validation:
        by_recording.setdefault(segment.recording, []).append(segment)
    gains = []
    for own in by_recording.values():
        X, y = _rows(grey, normal, own)
        gains.append(float((y**2).mean() - ((y - network(X)) ** 2).mean()))
    if len(gains) < _LEAST_LOOKS:
        return False
    return float(np.mean(gains)) > 2 * float(np.std(gains, ddof=1)) / float(np.sqrt(len(gains)))


def _rows(grey: GreyBox, normal: Normalisation, segments: list[Segment]) -> tuple[Floats, Floats]:
    X = [residual_features(normal, padded(segment.q, 1), grey.step_s) for segment in segments]
    rest = [segment.P - guess for segment, guess in zip(segments, predictions(grey, segments), strict=True)]
    return np.concatenate(X), np.concatenate(rest)


def _unpack(theta: Floats, inputs: int, scale: float) -> Perceptron:
    W, b, out = np.split(theta, [HIDDEN * inputs, HIDDEN * inputs + HIDDEN])
    return Perceptron(W.reshape(HIDDEN, inputs).copy(), b.copy(), scale * out)


def _loss(theta: Floats, X: Floats, y: Floats) -> tuple[float, Floats]:
    """Mean squared error with weight decay, and its gradient."""
    net = _unpack(theta, X.shape[1], 1.0)
    hidden = np.tanh(X @ net.W.T + net.b)
    error = hidden @ net.out - y
    back = (2 / len(y)) * error[:, None] * net.out * (1 - hidden**2)
    gradient = np.concatenate([(back.T @ X).ravel(), back.sum(axis=0), (2 / len(y)) * hidden.T @ error])
    return float((error**2).mean() + _WEIGHT_DECAY * theta @ theta), gradient + 2 * _WEIGHT_DECAY * theta
