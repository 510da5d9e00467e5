"""The fourteen combinations of Table 7.1: which network is trained on which trajectories."""

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
    """Networks with manual features on each kind and on all, the others on all. Raises UserError."""
    if len(kinds) != 2:
        raise UserError(
            f"Table 7.1 compares two kinds of trajectories, limited and all space; this dataset has {', '.join(kinds)}"
        )
    both: tuple[str, ...] = ()  # everything
    separate = [(name, (kind,)) for name in _MANUAL for kind in kinds]
    return [*separate, *((name, both) for name in ARCHITECTURES)]


def orders(template: TrainConfig, models: Path) -> list[TrainConfig]:
    """One order per combination, into bundles under `models`."""
    kinds = load_dataset(template.dataset).kinds
    return [
        replace(template, network=name, kinds=chosen, out=models / bundle_name(name, chosen, template.seed))
        for name, chosen in table_7_1(kinds)
    ]


def run_order(order: TrainConfig) -> tuple[str, dict[str, Any]]:
    """Train, unless the same was trained before: what a worker does. Returns the path and what bundle.json says."""
    if is_bundle(order.out):
        about = load_bundle(order.out).metadata
        same = about["provenance"]["manifest_sha256"] == load_dataset(order.dataset).digest
        if same and about.get("settings") == order.settings.as_json() and about["training"]["seed"] == order.seed:
            return str(order.out), about
    return str(order.out), train_one(order, _silent)


def _silent(what: str, share: float, left_s: float) -> None:
    """Workers report when they are done."""
