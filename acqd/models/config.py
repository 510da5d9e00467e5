"""What is asked of training, and what it hands over to be written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from acqd.models.bundle.bundle import Arrays
from acqd.models.networks.settings import TrainingSettings
from acqd.models.predictor import Predictor

GREY_BOX = "grey-box"
HYBRID = "hybrid"
Progress: TypeAlias = Callable[[str, float, float], None]
"""Gets what is done, its share, and the seconds left (NaN: unknown)."""


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """One model on one dataset."""

    dataset: Path
    network: str
    out: Path
    """The bundle's directory."""
    kinds: tuple[str, ...] = ()
    """Of trajectories to train on; none: all."""
    seed: int = 1
    settings: TrainingSettings = field(default_factory=TrainingSettings)
    robot: str | None = None
    """Description for the physical models; None: the dataset's."""
    withheld: tuple[str, ...] = ()
    """Groups of parameters that a grey box is denied: a model of deliberately poor structure, to judge others by."""


@dataclass(frozen=True, slots=True)
class Made:
    """A predictor and what its bundle has to say of it."""

    kind: str
    predictor: Predictor
    metadata: dict[str, Any]
    arrays: Arrays
    engine: str
