"""One epoch of training, and the validation between its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.errors import OperationError
from acqd.models.networks.architecture import Architecture
from acqd.models.networks.batches import Example, batches
from acqd.models.networks.checkpoint import Run
from acqd.models.networks.engine import Engine
from acqd.models.networks.flat_parameters import Float32s, views
from acqd.models.networks.settings import TrainingSettings


@dataclass(frozen=True, slots=True)
class Task:
    """What stays the same during a run."""

    engine: Engine
    settings: TrainingSettings
    scale_W: float
    """W per unit of the normalised power."""
    training: list[Any]
    """Batches in the engine's layout."""
    validation: list[Any]
    weights: list[float]
    """Rows of each validation batch."""
    decay: Float32s
    """[p] L2 factor of each parameter."""

    @classmethod
    def of(
        cls,
        engine: Engine,
        settings: TrainingSettings,
        scale_W: float,
        training: list[Example],
        validation: list[Example],
    ) -> Task:
        """Batch the examples and hand them to the engine."""
        architecture = engine.architecture
        margin = 2 * architecture.radius if architecture.kernels else 0
        train_batches = batches(training, settings.batch, margin)
        validation_batches = batches(validation, settings.batch, margin)
        return cls(
            engine,
            settings,
            scale_W,
            [engine.prepare(batch) for batch in train_batches],
            [engine.prepare(batch) for batch in validation_batches],
            [float(batch.target.size) for batch in validation_batches],
            _decay(architecture, engine.axes, settings.l2),
        )


def run_epoch(task: Task, run: Run) -> float:
    """One optimiser step per training batch. Returns the mean loss; raises OperationError when it diverges."""
    engine, settings, architecture = task.engine, task.settings, task.engine.architecture
    rate = settings.rate * settings.drop ** (run.epoch // settings.drop_period)
    total = 0.0
    for batch in task.training:
        loss, gradient = engine.gradient(run.parameters, batch)
        if not math.isfinite(loss):
            raise OperationError(f"{architecture.name} diverged in epoch {run.epoch}: try a smaller --learning-rate")
        norm = float(np.linalg.norm(gradient.astype(np.float64)))
        if not math.isfinite(norm):
            continue  # an overflowed gradient has no direction
        # gradient clipping by norm (Pascanu, Mikolov, Bengio 2013)
        gradient *= np.float32(min(1.0, settings.gradient_limit / max(norm, 1e-12)))
        gradient += task.decay * run.parameters
        run.adam.step(run.parameters, gradient, rate, architecture.betas, settings.epsilon)
        total += loss
        if run.adam.steps % settings.validation_every == 0:
            validate(task, run, total / len(task.training))
    return total / len(task.training)


def validate(task: Task, run: Run, train_loss: float) -> None:
    """Record the validation loss in `run`, and keep the parameters with the lowest one."""
    losses = [task.engine.loss(run.parameters, batch) for batch in task.validation]
    loss = float(np.average(losses, weights=task.weights))
    run.history.append((run.epoch, train_loss, loss))
    if loss < run.best_loss:
        run.best_loss, run.looks_since = loss, 0
        run.best = run.parameters.copy()
    else:
        run.looks_since += 1


def _decay(architecture: Architecture, axes: int, l2: float) -> Float32s:
    decay = np.zeros(architecture.learnables(axes), dtype=np.float32)
    for array in views(architecture, axes, decay).values():
        if array.ndim == 2:
            array[:] = l2
    return decay
