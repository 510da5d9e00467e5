"""Where loss and gradient of a batch come from: one interface, two engines."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from acqd.models.networks.architecture import Architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.flat_parameters import Singles


class Engine(ABC):
    """Squared error over a batch, for the learnables as a flat vector."""

    name: str

    def __init__(self, architecture: Architecture, axes: int) -> None:
        self.architecture = architecture
        self.axes = axes

    @abstractmethod
    def prepare(self, batch: Batch) -> Any:
        """The batch in the engine's own layout; done once."""

    @abstractmethod
    def gradient(self, theta: Singles, prepared: Any) -> tuple[float, Singles]:
        """Mean squared error over the batch, and its gradient in the order of `theta`."""

    @abstractmethod
    def loss(self, theta: Singles, prepared: Any) -> float:
        """Mean squared error alone."""
