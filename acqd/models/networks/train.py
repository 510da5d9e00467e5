"""Training of one network (thesis sections 7.1.4 and 7.5)."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import orjson

from acqd.compiling import system_compiler
from acqd.errors import OperationError, UserError
from acqd.models.networks.adam import Adam
from acqd.models.networks.architecture import Architecture
from acqd.models.networks.batches import Example, batches
from acqd.models.networks.checkpoint import Run, load_run, save_run
from acqd.models.networks.engine import Engine
from acqd.models.networks.flat_parameters import Singles, initial, views
from acqd.models.networks.predictor import NetworkPredictor, example_inputs
from acqd.models.networks.settings import TrainingSettings
from acqd.models.normalisation import Normalisation
from acqd.models.segments import Dataset, Segment

_SAVE_EVERY_S = 20.0


@dataclass(frozen=True, slots=True)
class EpochReport:
    """Where a run stands."""

    epoch: int
    epochs: int
    train_W: float
    """RMSE on training recordings, W."""
    validation_W: float
    """Best so far on validation recordings, W."""
    remaining_s: float


@dataclass(frozen=True, slots=True)
class Trained:
    """What came of it."""

    predictor: NetworkPredictor
    theta: Singles
    run: Run
    engine: str


def train(
    architecture: Architecture,
    data: Dataset,
    kinds: tuple[str, ...],
    seed: int,
    settings: TrainingSettings,
    checkpoint: Path,
    progress: Callable[[EpochReport], None],
) -> Trained:
    """Train, or go on where the checkpoint stands; who has saved the result removes it.

    Raises UserError, OperationError.
    """
    training, validation = data.part("train", kinds), data.part("validation", kinds)
    normal = Normalisation.thesis(data.axes)
    if settings.normalisation == "fitted":
        normal = Normalisation.fitted(training, data.step_s)
    engine = _engine(architecture, data.axes, settings)
    fingerprint = _fingerprint(architecture, data, kinds, seed, settings)
    run = load_run(checkpoint, fingerprint) or _fresh(architecture, data.axes, seed)
    _optimise(
        engine,
        _Task(architecture, training, validation, normal, data.step_s),
        run,
        settings,
        (lambda: save_run(checkpoint, run, fingerprint), progress),
    )
    predictor = NetworkPredictor(architecture, data.axes, data.step_s, run.best, normal)
    return Trained(predictor, run.best, run, engine.name)


def _engine(architecture: Architecture, axes: int, settings: TrainingSettings) -> Engine:
    fused = settings.compute == "fused" or (
        settings.compute == "auto" and settings.device == "cpu" and system_compiler() is not None
    )
    if settings.device != "cpu" and settings.compute == "fused":
        raise UserError(f"--compute fused is for the CPU, not for {settings.device}")
    if fused:
        from acqd.models.networks.fused.engine import FusedEngine

        return FusedEngine(architecture, axes)
    try:
        from acqd.models.networks.torch_engine import TorchEngine
    except ModuleNotFoundError:
        raise UserError("training with torch needs it: install acqd[model], or a C compiler") from None
    return TorchEngine(architecture, axes, settings.device)


@dataclass(frozen=True, slots=True)
class _Task:
    architecture: Architecture
    training: list[Segment]
    validation: list[Segment]
    normal: Normalisation
    step_s: float

    def examples(self, segments: list[Segment]) -> list[Example]:
        return [
            Example(
                example_inputs(self.architecture, self.normal, segment.q, self.step_s),
                ((segment.P - self.normal.P_offset) / self.normal.P_scale).astype(np.float32),
            )
            for segment in segments
        ]


def _fresh(architecture: Architecture, axes: int, seed: int) -> Run:
    theta = initial(architecture, axes, seed)
    return Run(theta, theta.copy(), Adam.fresh(len(theta)))


def _optimise(
    engine: Engine,
    task: _Task,
    run: Run,
    settings: TrainingSettings,
    report: tuple[Callable[[], None], Callable[[EpochReport], None]],
) -> None:
    save, progress = report
    margin = 2 * task.architecture.radius if task.architecture.kernels else 0
    ready = [engine.prepare(batch) for batch in batches(task.examples(task.training), settings.batch, margin)]
    weights = [float(b.target.size) for b in batches(task.examples(task.validation), settings.batch, margin)]
    looks = [engine.prepare(batch) for batch in batches(task.examples(task.validation), settings.batch, margin)]
    decay = _decay(task.architecture, engine.axes, settings.l2)
    begun, done_before, saved = time.monotonic(), run.seconds, time.monotonic()
    first_epoch = run.epoch
    while run.epoch < settings.epochs and not _patience_over(run, settings):
        rate = settings.rate * settings.drop ** (run.epoch // settings.drop_period)
        total = 0.0
        for batch in ready:
            loss, gradient = engine.gradient(run.theta, batch)
            if not math.isfinite(loss):
                raise OperationError(f"{task.architecture.name} diverged in epoch {run.epoch}: try a smaller --rate")
            norm = float(np.linalg.norm(gradient.astype(np.float64)))
            if not math.isfinite(norm):
                continue  # a step so steep says nothing of the direction
            gradient *= np.float32(min(1.0, settings.gradient_limit / max(norm, 1e-12)))
            gradient += decay * run.theta
            run.adam.step(run.theta, gradient, rate, task.architecture.betas, settings.epsilon)
            total += loss
            if run.adam.steps % settings.validation_every == 0:
                _look(engine, looks, weights, run, total / len(ready))
        run.epoch += 1
        run.seconds = done_before + time.monotonic() - begun
        pace = (time.monotonic() - begun) / (run.epoch - first_epoch)
        scale = task.normal.P_scale
        progress(
            EpochReport(
                run.epoch,
                settings.epochs,
                scale * math.sqrt(total / len(ready)),
                scale * math.sqrt(run.best_loss),
                pace * (settings.epochs - run.epoch),
            )
        )
        if time.monotonic() - saved > _SAVE_EVERY_S:
            save()
            saved = time.monotonic()
    _look(engine, looks, weights, run, float("nan"))


def _look(engine: Engine, looks: list[object], weights: list[float], run: Run, train_loss: float) -> None:
    losses = [engine.loss(run.theta, batch) for batch in looks]
    loss = float(np.average(losses, weights=weights))
    run.history.append((run.epoch, train_loss, loss))
    if loss < run.best_loss:
        run.best_loss, run.looks_since = loss, 0
        run.best = run.theta.copy()
    else:
        run.looks_since += 1


def _patience_over(run: Run, settings: TrainingSettings) -> bool:
    return settings.patience is not None and run.looks_since >= settings.patience


def _decay(architecture: Architecture, axes: int, l2: float) -> Singles:
    decay = np.zeros(architecture.learnables(axes), dtype=np.float32)
    for array in views(architecture, axes, decay).values():
        if array.ndim == 2:
            array[:] = l2
    return decay


def _fingerprint(
    architecture: Architecture, data: Dataset, kinds: tuple[str, ...], seed: int, settings: TrainingSettings
) -> str:
    metadata = [architecture.name, data.digest, kinds, seed, settings.as_json()]
    return hashlib.sha256(orjson.dumps(metadata)).hexdigest()
