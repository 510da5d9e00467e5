"""Adam (Kingma and Ba 2015, with bias correction; thesis Eq. 7.13) on a flat parameter vector."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.models.networks.flat_parameters import Float32s


@dataclass(slots=True)
class Adam:
    """First and second moments [p], and the number of steps taken."""

    mean: Float32s
    square: Float32s
    steps: int = 0

    @classmethod
    def zero(cls, size: int) -> Adam:
        """Zero moments."""
        return cls(np.zeros(size, dtype=np.float32), np.zeros(size, dtype=np.float32))

    def step(
        self, parameters: Float32s, gradient: Float32s, rate: float, betas: tuple[float, float], epsilon: float
    ) -> None:
        """Update `parameters` [p] in place."""
        self.steps += 1
        first, second = betas
        self.mean += (1 - first) * (gradient - self.mean)
        self.square += (1 - second) * (gradient * gradient - self.square)
        scale = rate * np.sqrt(1 - second**self.steps) / (1 - first**self.steps)
        parameters -= np.float32(scale) * self.mean / (np.sqrt(self.square) + np.float32(epsilon))
