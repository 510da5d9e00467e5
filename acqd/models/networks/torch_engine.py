"""`torch.nn.LSTM` as an engine, on a CPU or a CUDA device."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import torch

from acqd.errors import UserError
from acqd.models.networks.architecture import HEAD, HIDDEN, Architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.engine import Engine
from acqd.models.networks.flat_parameters import Float32s


class Network(torch.nn.Module):  # type: ignore[misc]  # mypy does not read torch (pyproject.toml)
    """One of the eight structures as a torch module."""

    def __init__(self, architecture: Architecture, axes: int) -> None:
        super().__init__()
        self._architecture = architecture
        if architecture.kernels:
            self.kernels = torch.nn.Conv1d(1, architecture.kernels, architecture.length)
        self.lstm = torch.nn.LSTM(architecture.width(axes), HIDDEN, batch_first=True)
        # torch has two biases per gate, MATLAB one: the second is held at zero
        second = dict(self.lstm.named_parameters())["bias_hh_l0"]
        torch.nn.init.zeros_(second)
        second.requires_grad_(False)
        sizes = (HIDDEN, *HEAD)
        self.head = torch.nn.Sequential(*(torch.nn.Linear(a, b) for a, b in itertools.pairwise(sizes)))

    def learnables(self) -> list[torch.Tensor]:
        """Learnable tensors in the order of `Architecture.shapes`."""
        tensors: list[torch.Tensor] = []
        if self._architecture.kernels:
            assert self.kernels.bias is not None
            tensors += [self.kernels.weight, self.kernels.bias]
        named = dict(self.lstm.named_parameters())
        tensors += [named[f"{name}_l0"] for name in ("weight_ih", "weight_hh", "bias_ih")]
        return tensors + list(self.head.parameters())

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Normalised power [B, T] of inputs [B, T or T + 2 radius, columns]."""
        if self._architecture.kernels:
            count, rows, axes = inputs.shape
            by_axis = inputs.transpose(1, 2).reshape(count * axes, 1, rows)
            maps = self.kernels(by_axis).reshape(count, axes, self._architecture.kernels, -1)
            inputs = maps.permute(0, 3, 2, 1).flatten(2)
        hidden, _ = self.lstm(inputs)
        out: torch.Tensor = self.head(hidden)
        return out[..., 0]


@dataclass(frozen=True, slots=True)
class _Prepared:
    inputs: torch.Tensor
    target: torch.Tensor


class TorchEngine(Engine):
    """Uses one thread on a CPU: networks this small gain nothing from more."""

    def __init__(self, architecture: Architecture, axes: int, device: str = "cpu") -> None:
        super().__init__(architecture, axes)
        self.name = f"torch {device}"
        torch.set_num_threads(1)
        try:
            self._device = torch.device(device)
            self._network = Network(architecture, axes).to(self._device)
        except (RuntimeError, AssertionError, NotImplementedError) as error:
            raise UserError(f"--processor {device}: {str(error).splitlines()[0]}; use cpu") from None
        # cuDNN rounds products to 10 bits (TF32) where nobody forbids it: gradients up to 0.1 % off, and no faster here
        torch.backends.cudnn.allow_tf32 = False
        self._learnables = self._network.learnables()

    def prepare(self, batch: Batch) -> _Prepared:
        """Copy the batch to the device."""
        return _Prepared(*(torch.from_numpy(array).to(self._device) for array in (batch.inputs, batch.target)))

    def gradient(self, parameters: Float32s, prepared: _Prepared) -> tuple[float, Float32s]:
        """By autograd."""
        self._load(parameters)
        error = torch.mean((self._network(prepared.inputs) - prepared.target) ** 2)
        gradients = torch.autograd.grad(error, self._learnables)
        gradient = torch.cat([tensor.reshape(-1) for tensor in gradients])
        return float(error.detach()), gradient.cpu().numpy()

    def loss(self, parameters: Float32s, prepared: _Prepared) -> float:
        """Forward pass only."""
        self._load(parameters)
        with torch.no_grad():
            return float(torch.mean((self._network(prepared.inputs) - prepared.target) ** 2))

    def _load(self, parameters: Float32s) -> None:
        flat = torch.from_numpy(np.array(parameters)).to(self._device)
        with torch.no_grad():
            first = 0
            for tensor in self._learnables:
                tensor.copy_(flat[first : first + tensor.numel()].view_as(tensor))
                first += tensor.numel()
