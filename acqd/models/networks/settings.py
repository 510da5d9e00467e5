"""How a network is trained: Table 7.3 of the thesis, and what it leaves open."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

Compute = Literal["auto", "fused", "torch"]


@dataclass(frozen=True, slots=True)
class TrainingSettings:
    """Defaults are the thesis'; what it does not state is MATLAB's default."""

    epochs: int = 2000
    batch: int = 11
    rate: float = 0.02
    drop: float = 0.9
    """Factor on the learning rate every `drop_period` epochs."""
    drop_period: int = 100
    epsilon: float = 1e-8
    l2: float = 1e-4
    """On weights, not on biases: MATLAB's default."""
    gradient_limit: float = 1.0
    """Norm that a gradient is scaled down to. The thesis sets none; over a thousand steps some then explode."""
    validation_every: int = 100
    """Optimiser steps between looks at the validation recordings."""
    patience: int | None = None
    """Looks without improvement after which training stops; None: never. The best look's network is kept."""
    normalisation: Literal["fitted", "thesis"] = "fitted"
    compute: Compute = "auto"
    device: str = "cpu"

    def as_json(self) -> dict[str, Any]:
        """For bundle.json."""
        return asdict(self)
