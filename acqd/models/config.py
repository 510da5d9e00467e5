"""Request and result of a training."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from acqd.models.bundle.bundle import Arrays
from acqd.models.greybox.fleet_prior import FleetPrior
from acqd.models.networks.settings import TrainingSettings
from acqd.models.predictor import Predictor

GREY_BOX = "grey-box"
HYBRID = "hybrid"
Progress: TypeAlias = Callable[[str, float, float], None]
"""Called with the present activity, the completed share, and the remaining seconds (NaN: unknown)."""


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """One model to be trained on one dataset."""

    dataset: Path
    """Folder of the dataset."""
    network: str
    """One of `training.NAMES`."""
    out: Path
    """Folder of the bundle."""
    kinds: tuple[str, ...] = ()
    """Kinds of trajectories to train on; empty: all."""
    seed: int = 1
    """Of initial weights, batches and random selections."""
    settings: TrainingSettings = field(default_factory=TrainingSettings)
    """Of a network; physical models ignore them."""
    robot: str | None = None
    """Robot description of the physical models; None: the one that the dataset names."""
    withheld: tuple[str, ...] = ()
    """Parameter groups that stay zero: a grey box of deliberately poor structure, to test `acqd close-loop`."""
    learned: FleetPrior | None = None
    """Prior of a grey box from other robots of its type; None: the description's only."""


@dataclass(frozen=True, slots=True)
class TrainedModel:
    """A predictor, and the entries of its bundle that depend on the kind of model."""

    kind: str
    """grey_box, hybrid or network."""
    predictor: Predictor
    metadata: dict[str, Any]
    """Entries of bundle.json."""
    arrays: Arrays
    engine: str
    """What computed the fit."""
