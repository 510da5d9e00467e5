"""The fourteen combinations of network and training data in Table 7.1 of the thesis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from acqd.errors import UserError
from acqd.models.bundle.bundle import is_bundle, load_bundle
from acqd.models.config import TrainConfig
from acqd.models.networks.architecture import ARCHITECTURES
from acqd.models.segments import load_dataset
from acqd.models.training import bundle_name, train_one

_MANUAL = ("7x1dim", "14x1dim", "21x1dim")


def table_7_1(kinds: list[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Pairs of network and kinds of trajectories (empty: all).

    Networks with manual features are trained on each kind and on all, the others on all. Raises UserError.
    """
    if len(kinds) != 2:
        raise UserError(
            f"Table 7.1 compares two kinds of trajectories, limited and all space; this dataset has {', '.join(kinds)}"
        )
    separate = [(name, (kind,)) for name in _MANUAL for kind in kinds]
    return [*separate, *((name, ()) for name in ARCHITECTURES)]


def table_7_1_configs(template: TrainConfig, models: Path) -> list[TrainConfig]:
    """One request per combination, with bundles in the folder `models`. Raises UserError."""
    kinds = load_dataset(template.dataset).kinds
    return [
        replace(template, network=name, kinds=chosen, out=models / bundle_name(name, chosen, template.seed))
        for name, chosen in table_7_1(kinds)
    ]


def train_unless_done(config: TrainConfig) -> tuple[str, dict[str, Any]]:
    """Train in a worker, unless the same bundle exists already. Returns its path and metadata."""
    if is_bundle(config.out):
        metadata = load_bundle(config.out).metadata
        same_data = metadata["provenance"]["manifest_sha256"] == load_dataset(config.dataset).digest
        same_settings = metadata.get("settings") == config.settings.as_json()
        if same_data and same_settings and metadata["training"]["seed"] == config.seed:
            return str(config.out), metadata
    return str(config.out), train_one(config, _silent)


def _silent(what: str, share: float, left_s: float) -> None:
    """A worker reports its result only."""
