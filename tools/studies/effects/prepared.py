"""What every case of a world needs: the effects that can act, the reference dataset and the model fitted on it."""

from __future__ import annotations

from pathlib import Path

from acqd.lab.effects import known_effects
from tools.studies.effects.cases import OUTSIDE_IDS, World, make_reference


def known_for(world: World) -> list[str]:
    """Effects of the library that can act in a world."""
    known = [name for name in known_effects() if name not in OUTSIDE_IDS]
    return known if world.assemblies else [name for name in known if name != "tool_actuation"]  # no tool switches


def prepared(world: World, base: str, epochs: int) -> Path:
    """The bundle of the model `base`, trained on the reference dataset; both are made unless they are there."""
    from acqd.models.config import TrainConfig
    from acqd.models.networks.settings import TrainingSettings
    from acqd.models.training import train_one

    bundle = world.folder / "models" / base
    dataset = make_reference(world)
    if not (bundle / "bundle.json").exists():
        train_one(TrainConfig(dataset, base, bundle, settings=TrainingSettings(epochs=epochs)), lambda *_: None)
    return bundle
