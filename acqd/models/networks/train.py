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

from acqd.c_builds import lstm
from acqd.compiling import why_unavailable
from acqd.errors import UserError
from acqd.instruction_sets import best_instruction_set
from acqd.models.networks.adam import Adam
from acqd.models.networks.architecture import Architecture
from acqd.models.networks.batches import Example
from acqd.models.networks.checkpoint import Run, load_run, save_run
from acqd.models.networks.engine import Engine
from acqd.models.networks.epoch import Task, run_epoch, validate
from acqd.models.networks.flat_parameters import Float32s, initial
from acqd.models.networks.predictor import NetworkPredictor, network_inputs
from acqd.models.networks.settings import TrainingSettings
from acqd.models.normalisation import Normalisation
from acqd.models.segments import Dataset, Segment

_SAVE_EVERY_S = 20.0


@dataclass(frozen=True, slots=True)
class EpochReport:
    """Progress of a run after an epoch."""

    epoch: int
    epochs: int
    train_W: float
    """RMSE on training recordings, W."""
    validation_W: float
    """Lowest RMSE so far on validation recordings, W."""
    remaining_s: float


@dataclass(frozen=True, slots=True)
class Trained:
    """A trained network."""

    predictor: NetworkPredictor
    parameters: Float32s
    """[p], with the lowest validation loss."""
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
    """Train a network, continuing from the checkpoint if it fits.

    The caller removes the checkpoint once the result is saved. Raises UserError, OperationError.
    """
    training, validation = data.part("train", kinds), data.part("validation", kinds)
    normal = Normalisation.thesis(data.axes)
    if settings.normalisation == "fitted":
        normal = Normalisation.fitted(training, data.step_s)
    engine = _engine(architecture, data.axes, settings)
    fingerprint = _fingerprint(architecture, data, kinds, seed, settings)
    run = load_run(checkpoint, fingerprint) or _new_run(architecture, data.axes, seed)
    examples = [_examples(architecture, normal, segments, data.step_s) for segments in (training, validation)]
    task = Task.of(engine, settings, normal.P_scale, *examples)
    _optimise(task, run, lambda: save_run(checkpoint, run, fingerprint), progress)
    predictor = NetworkPredictor(architecture, data.axes, data.step_s, run.best, normal)
    return Trained(predictor, run.best, run, engine.name)


def _engine(architecture: Architecture, axes: int, settings: TrainingSettings) -> Engine:
    fused = settings.compute == "fused" or (
        settings.compute == "auto"
        and settings.device == "cpu"
        and why_unavailable(lstm(best_instruction_set())) is None
    )
    if settings.device != "cpu" and settings.compute == "fused":
        raise UserError(f"--compute fused runs on the CPU only, not on {settings.device}")
    if fused:
        from acqd.models.networks.fused.engine import FusedEngine

        return FusedEngine(architecture, axes)
    try:
        from acqd.models.networks.torch_engine import TorchEngine
    except ModuleNotFoundError:
        raise UserError("training needs a C compiler or torch: install either, torch with acqd[model]") from None
    return TorchEngine(architecture, axes, settings.device)


def _examples(
    architecture: Architecture, normal: Normalisation, segments: list[Segment], step_s: float
) -> list[Example]:
    return [
        Example(
            network_inputs(architecture, normal, segment.around(architecture.radius), step_s).astype(np.float32),
            ((segment.P - normal.P_offset) / normal.P_scale).astype(np.float32),
        )
        for segment in segments
    ]


def _new_run(architecture: Architecture, axes: int, seed: int) -> Run:
    parameters = initial(architecture, axes, seed)
    return Run(parameters, parameters.copy(), Adam.zero(len(parameters)))


def _optimise(task: Task, run: Run, save: Callable[[], None], progress: Callable[[EpochReport], None]) -> None:
    settings = task.settings
    started, seconds_before, saved = time.monotonic(), run.seconds, time.monotonic()
    first_epoch = run.epoch
    while run.epoch < settings.epochs and not _out_of_patience(run, settings):
        loss = run_epoch(task, run)
        run.epoch += 1
        elapsed = time.monotonic() - started
        run.seconds = seconds_before + elapsed
        progress(
            EpochReport(
                run.epoch,
                settings.epochs,
                task.scale_W * math.sqrt(loss),
                task.scale_W * math.sqrt(run.best_loss),
                elapsed / (run.epoch - first_epoch) * (settings.epochs - run.epoch),
            )
        )
        if time.monotonic() - saved > _SAVE_EVERY_S:
            save()
            saved = time.monotonic()
    validate(task, run, float("nan"))


def _out_of_patience(run: Run, settings: TrainingSettings) -> bool:
    return settings.patience is not None and run.looks_since >= settings.patience


def _fingerprint(
    architecture: Architecture, data: Dataset, kinds: tuple[str, ...], seed: int, settings: TrainingSettings
) -> str:
    identity = [architecture.name, data.digest, kinds, seed, settings.as_json()]
    return hashlib.sha256(orjson.dumps(identity)).hexdigest()
