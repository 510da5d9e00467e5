"""Checkpoints: an interrupted training run continues with the same result as an uninterrupted one."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import orjson
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from acqd.models.networks.adam import Adam
from acqd.models.networks.flat_parameters import Float32s


@dataclass(slots=True)
class Run:
    """Everything that changes during training."""

    parameters: Float32s
    """[p], at the present step."""
    best: Float32s
    """[p], with the lowest validation loss so far."""
    adam: Adam
    epoch: int = 0
    """Completed epochs."""
    best_loss: float = float("inf")
    """Mean squared normalised error on validation."""
    looks_since: int = 0
    """Validations since the best one."""
    seconds: float = 0.0
    history: list[tuple[int, float, float]] = field(default_factory=list)
    """Epoch, training loss, validation loss."""


def save_run(path: Path, run: Run, fingerprint: str) -> None:
    """Write the checkpoint; a reader sees the old file or the new one, never a part."""
    state = {
        "epoch": run.epoch,
        "best_loss": run.best_loss if run.best_loss < float("inf") else None,
        "looks_since": run.looks_since,
        "seconds": run.seconds,
        "steps": run.adam.steps,
        "history": run.history,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".new")
    arrays = {"theta": run.parameters, "best": run.best, "mean": run.adam.mean, "square": run.adam.square}
    save_file(arrays, unfinished, metadata={"state": orjson.dumps(state).decode(), "fingerprint": fingerprint})
    os.replace(unfinished, path)


def load_run(path: Path, fingerprint: str) -> Run | None:
    """The run to continue. None without a checkpoint, or when its fingerprint (data and settings) differs."""
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata()
            if metadata.get("fingerprint") != fingerprint:
                return None
            arrays = {name: file.get_tensor(name) for name in ("theta", "best", "mean", "square")}
    except (OSError, SafetensorError):
        return None
    state = orjson.loads(metadata["state"])
    best_loss = float("inf") if state["best_loss"] is None else float(state["best_loss"])
    history = [(int(epoch), float(train), float(validation)) for epoch, train, validation in state["history"]]
    return Run(
        arrays["theta"],
        arrays["best"],
        Adam(arrays["mean"], arrays["square"], state["steps"]),
        state["epoch"],
        best_loss,
        state["looks_since"],
        state["seconds"],
        history,
    )
