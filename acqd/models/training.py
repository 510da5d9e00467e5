"""From a dataset to a bundle: any model by name, with metrics, envelope and provenance."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from acqd import __version__
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle, require_free, save_bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.reference import reference_arrays
from acqd.models.config import GREY_BOX, HYBRID, Made, Progress, TrainConfig
from acqd.models.metrics import measure, predictions
from acqd.models.networks.architecture import ARCHITECTURES, architecture
from acqd.models.segments import Dataset, load_dataset

NAMES = (*ARCHITECTURES, GREY_BOX, HYBRID)


def bundle_name(network: str, kinds: tuple[str, ...], seed: int) -> str:
    """`21x1dim-all+limited-s1`."""
    return f"{network}-{'+'.join(sorted(kinds)) or 'everything'}-s{seed}"


def train_one(order: TrainConfig, progress: Progress) -> dict[str, Any]:
    """Train and write the bundle; `progress` gets what is done, its share and the seconds left.

    Returns what bundle.json says. Raises UserError, OperationError.
    """
    if order.network not in NAMES:
        raise UserError(f"no network {order.network!r}; there are {', '.join(NAMES)}")
    require_free(order.out)
    data = load_dataset(order.dataset)
    begun = time.monotonic()
    training = data.part("train", order.kinds)
    made = _make(order, data, progress)
    metrics = {}
    for split in ("train", "validation", "test"):
        segments = data.part(split, order.kinds) if split != "test" else data.part(split)
        metrics[split] = measure(predictions(made.predictor, segments), segments).as_json()
    P = np.concatenate([segment.P for segment in training])
    metadata = {
        "kind": made.kind,
        "name": order.network,
        "robot": data.robot,
        "description": order.robot or data.description,
        "axes": data.axes,
        "step_s": data.step_s,
        "look_ahead_rows": made.predictor.radius,
        "inputs": [{"name": f"q{k + 1}", "unit": "rad"} for k in range(data.axes)]
        + [{"name": name, "unit": "0/1"} for name in made.predictor.signals],
        "target": "P",
        "unit": "W",
        "measured": data.measured,
        **made.metadata,
        "envelope": Envelope.of(training, data.step_s).as_json() | {"P_W": {"low": P.min(), "high": P.max()}},
        "metrics": metrics,
        "training": {"kinds": list(order.kinds) or data.kinds, "seed": order.seed, "engine": made.engine}
        | {"seconds": round(time.monotonic() - begun, 2)},
        "provenance": {
            "acqd": __version__,
            "dataset": str(order.dataset),
            "manifest_sha256": data.digest,
            "fit_recordings": sorted({segment.recording for segment in training}),
            "validation_recordings": sorted({s.recording for s in data.part("validation", order.kinds)}),
        },
    }
    save_bundle(order.out, Bundle(metadata, made.arrays, reference_arrays(data.segments)))
    _checkpoint(order).unlink(missing_ok=True)
    return metadata


def _checkpoint(order: TrainConfig) -> Path:
    return order.out.parent / ".checkpoints" / f"{order.out.name}.safetensors"


def _make(order: TrainConfig, data: Dataset, progress: Progress) -> Made:
    if order.network == GREY_BOX:
        from acqd.models.greybox.bundle_io import make_grey_box

        return make_grey_box(order, data, progress)
    if order.network == HYBRID:
        from acqd.models.hybrid.bundle_io import make_hybrid

        return make_hybrid(order, data, progress)
    from acqd.models.networks.train import EpochReport, train

    chosen = architecture(order.network)

    def report(at: EpochReport) -> None:
        what = f"epoch {at.epoch}, RMSE {at.train_W:.2f} W, validation {at.validation_W:.2f} W"
        progress(what, at.epoch / at.epochs, at.remaining_s)

    trained = train(chosen, data, order.kinds, order.seed, order.settings, _checkpoint(order), report)
    metadata = {
        "architecture": {"name": chosen.name, "learnables": chosen.learnables(data.axes)},
        "normalisation": trained.predictor.normal.as_json(),
        "settings": order.settings.as_json(),
        "history": trained.run.history[:: max(1, len(trained.run.history) // 200)],
        "epochs": trained.run.epoch,
    }
    return Made("network", trained.predictor, metadata, {"theta": trained.theta}, trained.engine)
