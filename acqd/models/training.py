"""Training of any model by name, and its bundle with metrics, envelope and provenance."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from acqd import __version__
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle, require_made_again, save_bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.reference import reference_arrays
from acqd.models.config import GREY_BOX, HYBRID, Progress, TrainConfig, TrainedModel
from acqd.models.metrics import measure, predictions
from acqd.models.networks.architecture import ARCHITECTURES, architecture
from acqd.models.segments import Dataset, load_dataset
from acqd.robot.description import load_description

NAMES = (*ARCHITECTURES, GREY_BOX, HYBRID)


def bundle_name(network: str, kinds: tuple[str, ...], seed: int) -> str:
    """Default name of a bundle, such as `21x1dim-all+limited-s1`."""
    return f"{network}-{'+'.join(sorted(kinds)) or 'everything'}-s{seed}"


def _same(config: TrainConfig, earlier: dict[str, Any]) -> bool:
    """Whether a bundle is of the model that is trained again: the same network, the same dataset, nothing added."""
    dataset = Path(str(earlier.get("provenance", {}).get("dataset", ""))).name
    added = "loop" in earlier
    return earlier.get("name") == config.network and dataset == config.dataset.resolve().name and not added


def train_one(config: TrainConfig, progress: Progress) -> dict[str, Any]:
    """Train a model and write its bundle. Returns the contents of bundle.json.

    Raises UserError, OperationError.
    """
    if config.network not in NAMES:
        raise UserError(f"no network {config.network!r}; the networks are {', '.join(NAMES)}")
    if config.seed < 0:
        raise UserError(f"seed {config.seed}: expected a whole number from 0 on")
    require_made_again(config.out, lambda earlier: _same(config, earlier))
    data = load_dataset(config.dataset)
    started = time.monotonic()
    training = data.part("train", config.kinds)
    trained = fit(config, data, progress)
    metrics = {}
    for split in ("train", "validation", "test"):
        segments = data.part(split, config.kinds) if split != "test" else data.part(split)
        metrics[split] = measure(predictions(trained.predictor, segments), segments).as_json()
    P = np.concatenate([segment.P for segment in training])
    validation = data.part("validation", config.kinds)
    metadata = {
        "kind": trained.kind,
        "name": config.network,
        "robot": data.robot,
        "description": config.robot or data.description,
        "axes": data.axes,
        "step_s": data.step_s,
        "look_ahead_rows": trained.predictor.radius,
        "inputs": [{"name": f"q{k + 1}", "unit": unit} for k, unit in enumerate(_position_units(config, data))]
        + [{"name": name, "unit": "0/1"} for name in trained.predictor.signals],
        "target": "P",
        "unit": "W",
        "measured": data.measured,
        **trained.metadata,
        "envelope": Envelope.of(training, data.step_s).as_json() | {"P_W": {"low": P.min(), "high": P.max()}},
        "metrics": metrics,
        "training": {"kinds": list(config.kinds) or data.kinds, "seed": config.seed, "engine": trained.engine}
        | {"seconds": round(time.monotonic() - started, 2)},
        "provenance": {
            "acqd": __version__,
            "dataset": str(config.dataset),
            "manifest_sha256": data.digest,
            "fit_recordings": sorted({segment.recording for segment in training}),
            "validation_recordings": sorted({segment.recording for segment in validation}),
            "dataset_content": data.content,
            "seen_content": sorted({segment.content for segment in [*training, *validation]}),
        },
    }
    save_bundle(config.out, Bundle(metadata, trained.arrays, reference_arrays(data.segments)))
    _checkpoint(config).unlink(missing_ok=True)
    return metadata


def _position_units(config: TrainConfig, data: Dataset) -> list[str]:
    """`rad` or `m` per axis. A network needs no description; without one its axes count as revolute."""
    try:
        sliding = load_description(config.robot or data.description).sliding
    except UserError:
        sliding = ()
    return ["m" if k in sliding else "rad" for k in range(data.axes)]


def _checkpoint(config: TrainConfig) -> Path:
    return config.out.parent / ".checkpoints" / f"{config.out.name}.safetensors"


def fit(config: TrainConfig, data: Dataset, progress: Progress) -> TrainedModel:
    """Train a model without writing its bundle; a network keeps a checkpoint near `config.out`. Raises UserError."""
    if config.network == GREY_BOX:
        from acqd.models.greybox.bundle_io import train_grey_box

        return train_grey_box(config, data, progress)
    if config.network == HYBRID:
        from acqd.models.hybrid.bundle_io import train_hybrid

        return train_hybrid(config, data, progress)
    from acqd.models.networks.train import EpochReport, train

    chosen = architecture(config.network)

    def report(epoch: EpochReport) -> None:
        text = f"epoch {epoch.epoch}, RMSE {epoch.train_W:.2f} W, validation {epoch.validation_W:.2f} W"
        progress(text, epoch.epoch / epoch.epochs, epoch.remaining_s)

    trained = train(chosen, data, config.kinds, config.seed, config.settings, _checkpoint(config), report)
    metadata = {
        "architecture": {"name": chosen.name, "learnables": chosen.learnables(data.axes)},
        "normalisation": trained.predictor.normal.as_json(),
        "settings": config.settings.as_json(),
        "history": trained.run.history[:: max(1, len(trained.run.history) // 200)],
        "epochs": trained.run.epoch,
    }
    return TrainedModel("network", trained.predictor, metadata, {"theta": trained.parameters}, trained.engine)
