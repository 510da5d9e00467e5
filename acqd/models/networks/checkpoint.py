"""A training run on disk, so that one that was stopped goes on as if it had not been."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import orjson
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from acqd.models.networks.adam import Adam
from acqd.models.networks.flat_parameters import Singles


@dataclass(slots=True)
class Run:
    """Everything that changes while training."""

    theta: Singles
    best: Singles
    """The learnables that did best on validation."""
    adam: Adam
    epoch: int = 0
    """Epochs done."""
    best_loss: float = float("inf")
    """Mean squared normalised error on validation."""
    looks_since: int = 0
    seconds: float = 0.0
    history: list[tuple[int, float, float]] = field(default_factory=list)
    """Epoch, training loss, validation loss."""


def save_run(path: Path, run: Run, fingerprint: str) -> None:
    """Replace the checkpoint at once."""
    state = {
        "epoch": run.epoch,
        "best_loss": run.best_loss if run.best_loss < float("inf") else None,
        "looks_since": run.looks_since,
        "seconds": run.seconds,
        "steps": run.adam.steps,
        "history": run.history,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(".new")
    arrays = {"theta": run.theta, "best": run.best, "mean": run.adam.mean, "square": run.adam.square}
    save_file(arrays, beside, metadata={"state": orjson.dumps(state).decode(), "fingerprint": fingerprint})
    os.replace(beside, path)


def load_run(path: Path, fingerprint: str) -> Run | None:
    """The run to go on with; None when there is none, or it was of other data or settings."""
    try:
        with safe_open(path, framework="numpy") as file:
            about = file.metadata()
            if about.get("fingerprint") != fingerprint:
                return None
            arrays = {name: file.get_tensor(name) for name in ("theta", "best", "mean", "square")}
    except (OSError, SafetensorError):
        return None
    state = orjson.loads(about["state"])
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
