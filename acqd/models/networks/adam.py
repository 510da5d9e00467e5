"""Adam on a flat vector (thesis Eq. 7.13, with the bias correction of Kingma and Ba)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.models.networks.flat_parameters import Singles


@dataclass(slots=True)
class Adam:
    """Moments and the number of steps taken."""

    mean: Singles
    square: Singles
    steps: int = 0

    @classmethod
    def fresh(cls, size: int) -> Adam:
        """Before the first step."""
        return cls(np.zeros(size, dtype=np.float32), np.zeros(size, dtype=np.float32))

    def step(self, theta: Singles, gradient: Singles, rate: float, betas: tuple[float, float], epsilon: float) -> None:
        """Move `theta` in place."""
        self.steps += 1
        first, second = betas
        self.mean += (1 - first) * (gradient - self.mean)
        self.square += (1 - second) * (gradient * gradient - self.square)
        scale = rate * np.sqrt(1 - second**self.steps) / (1 - first**self.steps)
        theta -= np.float32(scale) * self.mean / (np.sqrt(self.square) + np.float32(epsilon))
