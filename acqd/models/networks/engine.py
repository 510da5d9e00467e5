"""Interface of the engines that compute loss and gradient of a batch."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from acqd.models.networks.architecture import Architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.flat_parameters import Float32s


class Engine(ABC):
    """Mean squared error of a batch as a function of the flat parameter vector."""

    name: str

    def __init__(self, architecture: Architecture, axes: int) -> None:
        self.architecture = architecture
        self.axes = axes

    @abstractmethod
    def prepare(self, batch: Batch) -> Any:
        """The batch in the memory layout of the engine. Called once per batch, before training."""

    @abstractmethod
    def gradient(self, parameters: Float32s, prepared: Any) -> tuple[float, Float32s]:
        """Mean squared error over the batch, and its gradient [p] in the order of `parameters` [p]."""

    @abstractmethod
    def loss(self, parameters: Float32s, prepared: Any) -> float:
        """Mean squared error without the gradient."""
