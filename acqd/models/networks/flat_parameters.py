"""The parameters of a network as one flat vector, and the affine layers of its head folded into one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from acqd.models.networks.architecture import HEAD, HIDDEN, Architecture

Float32s: TypeAlias = NDArray[np.float32]


def views(architecture: Architecture, axes: int, parameters: Float32s) -> dict[str, Float32s]:
    """Named arrays that share memory with the flat vector."""
    arrays, first = {}, 0
    for name, shape in architecture.shapes(axes).items():
        size = int(np.prod(shape))
        arrays[name] = parameters[first : first + size].reshape(shape)
        first += size
    return arrays


def initial(architecture: Architecture, axes: int, seed: int) -> Float32s:
    """MATLAB's initial values: Glorot weights, orthogonal recurrent weights, forget-gate biases of one."""
    random = np.random.default_rng(seed)
    parameters = np.zeros(architecture.learnables(axes), dtype=np.float32)
    for name, array in views(architecture, axes, parameters).items():
        if name == "b":
            array[HIDDEN : 2 * HIDDEN] = 1.0
        elif name == "R":
            basis, triangle = np.linalg.qr(random.standard_normal(array.shape))
            array[:] = basis * np.sign(np.diag(triangle))
        elif array.ndim == 2:
            limit = np.sqrt(6.0 / sum(array.shape))
            array[:] = random.uniform(-limit, limit, array.shape)
    return parameters


@dataclass(frozen=True, slots=True)
class Head:
    """The fully connected layers folded into one affine map, and the layers that its gradient is unfolded onto."""

    weight: Float32s
    """[HIDDEN]."""
    bias: float
    layers: list[tuple[Float32s, Float32s]]

    @classmethod
    def fold(cls, arrays: dict[str, Float32s]) -> Head:
        """Multiply the layers `fc0` to `fc3` of `arrays`."""
        layers = [(arrays[f"fc{n}"], arrays[f"fc{n}_bias"]) for n in range(len(HEAD))]
        weight, bias = layers[0]
        for W, b in layers[1:]:
            weight, bias = W @ weight, W @ bias + b
        return cls(weight[0], float(bias[0]), layers)

    def unfold(self, d_weight: Float32s, d_bias: float, into: dict[str, Float32s]) -> None:
        """Write the gradient of the folded map as gradients of its layers (chain rule).

        y = W_n (... (W_1 h + b_1) ...) + b_n. Layer k receives M h + m from the layers before it, and the layers
        after it multiply its output by `after`: dW_k = after^T (d_weight M^T + d_bias m^T), db_k = after^T d_bias.
        """
        outer: list[Float32s] = [np.ones((1, 1), dtype=np.float32)]
        for W, _ in reversed(self.layers[1:]):
            outer.append(outer[-1] @ W)
        M, m = np.eye(HIDDEN, dtype=np.float32), np.zeros(HIDDEN, dtype=np.float32)
        for number, ((W, b), after) in enumerate(zip(self.layers, reversed(outer), strict=True)):
            into[f"fc{number}"][:] = np.outer(after[0], M @ d_weight + d_bias * m)
            into[f"fc{number}_bias"][:] = after[0] * d_bias
            M, m = W @ M, W @ m + b
