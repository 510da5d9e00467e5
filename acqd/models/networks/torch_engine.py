"""`torch.nn.LSTM` behind the engine's interface: portable, on CPU or CUDA."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import torch

from acqd.errors import UserError
from acqd.models.networks.architecture import HEAD, HIDDEN, Architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.engine import Engine
from acqd.models.networks.flat_parameters import Singles


class Network(torch.nn.Module):
    """One of the eight structures."""

    def __init__(self, architecture: Architecture, axes: int) -> None:
        super().__init__()
        self._architecture = architecture
        if architecture.kernels:
            self.kernels = torch.nn.Conv1d(1, architecture.kernels, architecture.length)
        self.lstm = torch.nn.LSTM(architecture.width(axes), HIDDEN, batch_first=True)
        # torch keeps two biases per gate; MATLAB one: the second stays zero
        second = dict(self.lstm.named_parameters())["bias_hh_l0"]
        torch.nn.init.zeros_(second)
        second.requires_grad_(False)
        sizes = (HIDDEN, *HEAD)
        self.head = torch.nn.Sequential(*(torch.nn.Linear(a, b) for a, b in itertools.pairwise(sizes)))

    def learnables(self) -> list[torch.Tensor]:
        """In the order of Architecture.shapes."""
        found: list[torch.Tensor] = []
        if self._architecture.kernels:
            assert self.kernels.bias is not None
            found += [self.kernels.weight, self.kernels.bias]
        named = dict(self.lstm.named_parameters())
        found += [named[f"{name}_l0"] for name in ("weight_ih", "weight_hh", "bias_ih")]
        return found + list(self.head.parameters())

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """[B, T or T + 2 radius, columns] -> [B, T]."""
        if self._architecture.kernels:
            count, rows, axes = inputs.shape
            each = inputs.transpose(1, 2).reshape(count * axes, 1, rows)
            maps = self.kernels(each).reshape(count, axes, self._architecture.kernels, -1)
            inputs = maps.permute(0, 3, 2, 1).flatten(2)
        hidden, _ = self.lstm(inputs)
        out: torch.Tensor = self.head(hidden)
        return out[..., 0]


@dataclass(frozen=True, slots=True)
class _Prepared:
    inputs: torch.Tensor
    target: torch.Tensor


class TorchEngine(Engine):
    """One thread on a CPU: with more, networks so small only wait for each other."""

    def __init__(self, architecture: Architecture, axes: int, device: str = "cpu") -> None:
        super().__init__(architecture, axes)
        self.name = f"torch {device}"
        torch.set_num_threads(1)
        try:
            self._device = torch.device(device)
            self._network = Network(architecture, axes).to(self._device)
        except (RuntimeError, AssertionError, NotImplementedError) as error:
            raise UserError(f"--device {device}: {str(error).splitlines()[0]}; use cpu") from None
        self._learnables = self._network.learnables()

    def prepare(self, batch: Batch) -> _Prepared:
        """On the device."""
        return _Prepared(*(torch.from_numpy(array).to(self._device) for array in (batch.inputs, batch.target)))

    def gradient(self, theta: Singles, prepared: _Prepared) -> tuple[float, Singles]:
        """See Engine."""
        self._load(theta)
        error = torch.mean((self._network(prepared.inputs) - prepared.target) ** 2)
        found = torch.autograd.grad(error, self._learnables)
        gradient = torch.cat([each.reshape(-1) for each in found])
        return float(error.detach()), gradient.cpu().numpy()

    def loss(self, theta: Singles, prepared: _Prepared) -> float:
        """See Engine."""
        self._load(theta)
        with torch.no_grad():
            return float(torch.mean((self._network(prepared.inputs) - prepared.target) ** 2))

    def _load(self, theta: Singles) -> None:
        flat = torch.from_numpy(np.array(theta)).to(self._device)
        with torch.no_grad():
            first = 0
            for each in self._learnables:
                each.copy_(flat[first : first + each.numel()].view_as(each))
                first += each.numel()
