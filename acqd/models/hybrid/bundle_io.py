"""Training of hybrids, and their entries in bundles: first the grey box is fitted, then a network to its residual."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import minimize

from acqd.arrays import Floats
from acqd.models.bundle.bundle import Arrays
from acqd.models.config import Progress, TrainConfig, TrainedModel
from acqd.models.greybox.bundle_io import arrays_of, describe, fitted, learned_from, restore
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid, Perceptron, residual_features
from acqd.models.metrics import predictions
from acqd.models.normalisation import Normalisation

if TYPE_CHECKING:
    from acqd.models.segments import Dataset, Segment

HIDDEN = 12
_WEIGHT_DECAY = 1e-4
_ROUNDS, _STEPS_A_ROUND = 30, 10
_MAX_ROWS = 150_000
_MIN_RECORDINGS = 4  # validation recordings, for a standard error over them


def train_hybrid(config: TrainConfig, data: Dataset, progress: Progress) -> TrainedModel:
    """Fit the grey box, then the network. Raises UserError."""
    fit = fitted(config, data, progress)
    training, validation = data.part("train", config.kinds), data.part("validation", config.kinds)
    normal = Normalisation.fitted(training, data.step_s)
    network, gain = _fit_residual(fit.model, normal, training, validation, config.seed, progress)
    model = Hybrid(fit.model, network, normal)
    metadata = (
        describe(fit)
        | {
            "architecture": {
                "hidden": HIDDEN,
                "learnables": int(sum(array.size for array in (network.W, network.b, network.out))),
            },
            "normalisation": normal.as_json(),
            "validation_gain": gain,
        }
        | learned_from(config)
    )
    arrays = (
        arrays_of(fit.model)
        | fit.likelihood.arrays()
        | {"rest_W": network.W, "rest_b": network.b, "rest_out": network.out}
    )
    return TrainedModel("hybrid", model, metadata, arrays, "Gauss-Newton, L-BFGS")


def restore_hybrid(metadata: dict[str, Any], arrays: Arrays) -> Hybrid:
    """The hybrid of a bundle. Raises KeyError or ValueError when an array is missing or has a wrong shape."""
    network = Perceptron(arrays["rest_W"], arrays["rest_b"], arrays["rest_out"])
    return Hybrid(restore(metadata, arrays), network, Normalisation.from_json(metadata["normalisation"]))


def _fit_residual(
    grey: GreyBox,
    normal: Normalisation,
    training: list[Segment],
    validation: list[Segment],
    seed: int,
    progress: Progress,
) -> tuple[Perceptron, float]:
    """Network of the round with the lowest validation error, and the share by which it reduces the MSE there.

    The network is zero when no round reduces the validation error significantly.
    """
    random = np.random.default_rng(seed)
    X, y = _rows(grey, normal, training)
    if len(y) > _MAX_ROWS:
        kept = random.choice(len(y), _MAX_ROWS, replace=False)
        X, y = X[kept], y[kept]
    X_validation, y_validation = _rows(grey, normal, validation)
    inputs = X.shape[1]
    scale = max(float(y.std()), 1e-9)
    flat = np.concatenate([random.normal(0, 1 / np.sqrt(inputs), HIDDEN * inputs), np.zeros(2 * HIDDEN)])
    flat[-HIDDEN:] = random.normal(0, 0.1, HIDDEN)
    loss_without = float((y_validation**2).mean())
    zero = _unpack(np.zeros_like(flat), inputs, 0.0)
    best, best_loss = zero, loss_without
    for number in range(_ROUNDS):
        result = minimize(
            _loss, flat, (X, y / scale), method="L-BFGS-B", jac=True, options={"maxiter": _STEPS_A_ROUND, "maxcor": 20}
        )
        flat = result.x
        network = _unpack(flat, inputs, scale)
        loss = float(((y_validation - network(X_validation)) ** 2).mean())
        if loss < best_loss:
            best, best_loss = network, loss
        progress("fitting the residual", (number + 1) / _ROUNDS, float("nan"))
    if not _helps(best, grey, normal, validation):
        return zero, 0.0
    return best, 1 - best_loss / loss_without


def _helps(network: Perceptron, grey: GreyBox, normal: Normalisation, validation: list[Segment]) -> bool:
    """Whether the mean reduction of the squared error exceeds two standard errors over recordings.

    The threshold allows for the selection of the best of 30 rounds.
    """
    by_recording: dict[str, list[Segment]] = {}
    for segment in validation:
        by_recording.setdefault(segment.recording, []).append(segment)
    gains = []
    for segments in by_recording.values():
        X, y = _rows(grey, normal, segments)
        gains.append(float((y**2).mean() - ((y - network(X)) ** 2).mean()))
    if len(gains) < _MIN_RECORDINGS:
        return False
    return float(np.mean(gains)) > 2 * float(np.std(gains, ddof=1)) / float(np.sqrt(len(gains)))


def _rows(grey: GreyBox, normal: Normalisation, segments: list[Segment]) -> tuple[Floats, Floats]:
    X = [residual_features(normal, segment.around(1), grey.step_s) for segment in segments]
    residuals = [s.P - predicted for s, predicted in zip(segments, predictions(grey, segments), strict=True)]
    return np.concatenate(X), np.concatenate(residuals)


def _unpack(flat: Floats, inputs: int, scale: float) -> Perceptron:
    W, b, out = np.split(flat, [HIDDEN * inputs, HIDDEN * inputs + HIDDEN])
    return Perceptron(W.reshape(HIDDEN, inputs).copy(), b.copy(), scale * out)


def _loss(flat: Floats, X: Floats, y: Floats) -> tuple[float, Floats]:
    """Mean squared error with weight decay, and its gradient."""
    net = _unpack(flat, X.shape[1], 1.0)
    hidden = np.tanh(X @ net.W.T + net.b)
    error = hidden @ net.out - y
    back = (2 / len(y)) * error[:, None] * net.out * (1 - hidden**2)
    gradient = np.concatenate([(back.T @ X).ravel(), back.sum(axis=0), (2 / len(y)) * hidden.T @ error])
    return float((error**2).mean() + _WEIGHT_DECAY * flat @ flat), gradient + 2 * _WEIGHT_DECAY * flat
