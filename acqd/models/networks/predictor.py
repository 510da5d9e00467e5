"""Prediction with a trained network, in plain numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.features import derivatives, padded
from acqd.models.networks.architecture import HIDDEN, Architecture
from acqd.models.networks.flat_parameters import Float32s, Head, views
from acqd.models.normalisation import Normalisation
from acqd.models.predictor import Predictor


def network_inputs(architecture: Architecture, normal: Normalisation, q: Floats, step_s: float) -> Floats:
    """Normalised inputs of the network, of angles `q` [T + 2 radius, axes].

    Convolution kernels get normalised angles [T + 2 radius, axes], the other structures features [T, width].
    """
    if architecture.inputs == "frames":
        return normal.inputs(0, q)
    if architecture.inputs == "q":
        return normal.inputs(0, q)
    qd, qdd = derivatives(q, step_s)
    orders = [normal.inputs(0, q[1:-1]), normal.inputs(1, qd), normal.inputs(2, qdd)]
    return np.concatenate(orders[: architecture.inputs.count(",") + 1], axis=1)


_HALVES = np.repeat([0.5, 0.5, 1.0, 0.5], HIDDEN)
_LEVELS = np.repeat([0.5, 0.5, 0.0, 0.5], HIDDEN)
"""Input, forget and output gate are sigmoids, 1/2 + 1/2 tanh(x / 2), the third is tanh(x): one call does for all."""


@dataclass(slots=True)
class _State:
    hidden: Floats
    cell: Floats


class NetworkPredictor(Predictor):
    """LSTM(10) on manual features or convolution kernels, with the folded head."""

    def __init__(
        self, architecture: Architecture, axes: int, step_s: float, parameters: Float32s, normal: Normalisation
    ) -> None:
        self.architecture = architecture
        self.axes = axes
        self.step_s = step_s
        self.radius = architecture.radius
        self.normal = normal
        self.arrays = views(architecture, axes, parameters)
        W, R, b = (self.arrays[name].astype(np.float64) for name in ("W", "R", "b"))
        self._W, self._R, self._b = W * _HALVES[:, None], R * _HALVES[:, None], b * _HALVES
        head = Head.fold(self.arrays)
        self._out, self._out_bias = head.weight.astype(np.float64), head.bias

    def run(self, q: Floats, signals: Floats) -> Floats:
        """The LSTM over the whole sequence, from zero state."""
        state = self.start()
        driven = self._features(q) @ self._W.T + self._b
        hidden = np.empty((len(driven), HIDDEN))
        for t, row in enumerate(driven):
            hidden[t] = self._advance(state, row)
        return np.asarray((hidden @ self._out + self._out_bias) * self.normal.P_scale + self.normal.P_offset)

    def start(self) -> _State:
        """Zero hidden and cell state."""
        return _State(np.zeros(HIDDEN), np.zeros(HIDDEN))

    def step(self, state: _State, window: Floats, signals: Floats) -> float:
        """One step of the LSTM."""
        hidden = self._advance(state, self._W @ self._features(window)[0] + self._b)
        return float(hidden @ self._out + self._out_bias) * self.normal.P_scale + self.normal.P_offset

    def head(self) -> tuple[Floats, float]:
        """Weights [HIDDEN] and bias of the folded affine head, in normalised power."""
        return self._out, float(self._out_bias)

    def _features(self, q: Floats) -> Floats:
        inputs = network_inputs(self.architecture, self.normal, q, self.step_s)
        if not self.architecture.kernels:
            return inputs
        frames = np.lib.stride_tricks.sliding_window_view(inputs, self.architecture.length, axis=0)
        maps = np.einsum("tal,ql->tqa", frames, self.arrays["kernel"]) + self.arrays["kernel_bias"][:, None]
        return np.asarray(maps.reshape(len(frames), -1))

    def _advance(self, state: _State, driven: Floats) -> Floats:
        """From [4 HIDDEN] inputs of the gates; few calls, because each takes longer than its ten numbers."""
        gates = np.tanh(driven + self._R @ state.hidden)
        gates *= _HALVES
        gates += _LEVELS
        forgotten = gates[HIDDEN : 2 * HIDDEN] * state.cell
        state.cell = forgotten + gates[:HIDDEN] * gates[2 * HIDDEN : 3 * HIDDEN]
        state.hidden = gates[3 * HIDDEN :] * np.tanh(state.cell)
        return state.hidden


def example_inputs(architecture: Architecture, normal: Normalisation, q: Floats, step_s: float) -> Float32s:
    """Training inputs of a segment with angles [T, axes], the ends padded."""
    return network_inputs(architecture, normal, padded(q, architecture.radius), step_s).astype(np.float32)
