"""How far predictions are off (thesis Eq. 8.1 to 8.3), and the energy that a recording is off by."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from acqd.arrays import Floats
from acqd.models.predictor import Predictor

if TYPE_CHECKING:
    from acqd.models.segments import Segment


@dataclass(frozen=True, slots=True)
class Metrics:
    """Over all rows of some recordings."""

    mae: float
    """W."""
    rmse: float
    """W."""
    bias: float
    """W, prediction minus measurement."""
    r2: float
    """Explained share of the measured power's variance."""
    energy_p95: float
    """|energy error| of a recording, relative, that 95 % stay below."""
    rows: int
    recordings: int

    def as_json(self) -> dict[str, float]:
        """For bundle.json."""
        return asdict(self)


def signals_of(model: Predictor, segment: Segment) -> Floats | None:
    """The logged states that a model uses, or None where one is missing."""
    known = segment.signals | {"Vrms": segment.channels["Vrms"]} if "Vrms" in segment.channels else segment.signals
    if not all(name in known for name in model.signals):
        return None
    return np.column_stack([np.zeros((len(segment.P), 0)), *(known[name] for name in model.signals)])


def predictions(model: Predictor, segments: Iterable[Segment]) -> list[Floats]:
    """[T] W for each stretch."""
    return [model.sequence(segment.q, signals_of(model, segment), segment.start_s) for segment in segments]


def measure(predicted: list[Floats], segments: list[Segment]) -> Metrics:
    """Of predictions beside what was measured."""
    error = np.concatenate([guess - segment.P for guess, segment in zip(predicted, segments, strict=True)])
    P = np.concatenate([segment.P for segment in segments])
    energy: dict[str, list[float]] = {}
    for guess, segment in zip(predicted, segments, strict=True):
        sums = energy.setdefault(segment.recording, [0.0, 0.0])
        sums[0] += float(guess.sum())
        sums[1] += float(segment.P.sum())
    off = [abs(guess - true) / max(abs(true), 1e-9) for guess, true in energy.values()]
    return Metrics(
        float(np.abs(error).mean()),
        float(np.sqrt((error**2).mean())),
        float(error.mean()),
        float(1 - (error**2).mean() / max(P.var(), 1e-12)),
        float(np.percentile(off, 95)),
        len(error),
        len(energy),
    )
