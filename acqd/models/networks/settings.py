"""Settings of a training run: Table 7.3 of the thesis, and what the table does not state."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

Compute = Literal["auto", "fused", "torch"]


@dataclass(frozen=True, slots=True)
class TrainingSettings:
    """Defaults are the thesis'. Where the thesis states none, they are MATLAB's."""

    epochs: int = 2000
    batch: int = 11
    rate: float = 0.02
    drop: float = 0.9
    """Factor on the learning rate every `drop_period` epochs."""
    drop_period: int = 100
    epsilon: float = 1e-8
    l2: float = 1e-4
    """Factor of the L2 penalty on weights, not on biases (MATLAB's default)."""
    gradient_limit: float = 1.0
    """Gradient clipping: gradients of a larger norm are scaled down to this norm. The thesis clips none, and some
    networks then diverge."""
    validation_every: int = 100
    """Optimiser steps between evaluations on the validation recordings."""
    patience: int | None = None
    """Evaluations without improvement after which training stops; None: never. The best network is kept."""
    normalisation: Literal["fitted", "thesis"] = "fitted"
    compute: Compute = "auto"
    device: str = "cpu"

    def as_json(self) -> dict[str, Any]:
        """For bundle.json."""
        return asdict(self)
