"""Errors of predicted power (thesis Eq. 8.1 to 8.3) and of the predicted energy of a recording."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from acqd.arrays import Floats
from acqd.models.predictor import Predictor, Recorded

if TYPE_CHECKING:
    from acqd.models.segments import Segment


@dataclass(frozen=True, slots=True)
class Metrics:
    """Errors over all rows of a set of recordings."""

    mae: float
    """Mean absolute error, W."""
    rmse: float
    """Root mean squared error, W."""
    bias: float
    """W, predicted minus measured."""
    r2: float
    """Coefficient of determination; a bias counts against it."""
    energy_p95: float
    """95th percentile over recordings of the relative energy error |predicted - measured| / measured."""
    rows: int
    recordings: int

    def as_json(self) -> dict[str, float]:
        """All figures by name."""
        return asdict(self)


def signals_of(model: Predictor, segment: Segment) -> Floats | None:
    """[T, k] logged signals that a model uses; None when one of them was not logged."""
    known = segment.signals | {"Vrms": segment.channels["Vrms"]} if "Vrms" in segment.channels else segment.signals
    if not all(name in known for name in model.signals):
        return None
    return np.column_stack([np.zeros((len(segment.P), 0)), *(known[name] for name in model.signals)])


def predictions(model: Predictor, segments: Iterable[Segment]) -> list[Floats]:
    """Predicted power [T] W of each segment."""
    return [_prediction(model, segment) for segment in segments]


def _prediction(model: Predictor, segment: Segment) -> Floats:
    """[T] W of the segment's rows."""
    asked = recorded(model, segment)
    power = model.recording(asked.q, asked.signals, asked.start_s)
    return power[asked.before : asked.before + len(segment.P)]


def recorded(model: Predictor, segment: Segment) -> Recorded:
    """A segment as a model is asked about it: with the rows before and after a piece of a motion, signals held."""
    q, before, after = segment.extended()
    signals = signals_of(model, segment)
    if signals is not None:
        signals = np.pad(signals, ((before, after), (0, 0)), mode="edge")
    return Recorded(q, signals, segment.start_s - before * model.step_s, before)


def measure(predicted: list[Floats], segments: list[Segment]) -> Metrics:
    """Errors of `predicted` power [T] W per segment against the measured power."""
    error = np.concatenate([power - segment.P for power, segment in zip(predicted, segments, strict=True)])
    P = np.concatenate([segment.P for segment in segments])
    energy: dict[str, list[float]] = {}
    for power, segment in zip(predicted, segments, strict=True):
        sums = energy.setdefault(segment.recording, [0.0, 0.0])
        sums[0] += float(power.sum())
        sums[1] += float(segment.P.sum())
    energy_errors = [abs(sum_predicted - true) / max(abs(true), 1e-9) for sum_predicted, true in energy.values()]
    return Metrics(
        float(np.abs(error).mean()),
        float(np.sqrt((error**2).mean())),
        float(error.mean()),
        float(1 - (error**2).mean() / max(P.var(), 1e-12)),
        float(np.percentile(energy_errors, 95)),
        len(error),
        len(energy),
    )
