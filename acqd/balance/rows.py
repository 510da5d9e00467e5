"""All rows of some recordings with the parts of their predicted power."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.causes import parts_of, require_parts
from acqd.models.effects.cause import Cause
from acqd.models.predictor import Predictor
from acqd.models.segments import Dataset, Segment
from acqd.models.yearly import moving_rows


@dataclass(frozen=True, slots=True)
class RowsPart:
    """A part of the power of all rows."""

    cause: Cause
    name: str
    added: bool
    """An effect that the loop added to the model."""
    joints: Floats
    """[T, axes + 1] W by joint; the last column is of no joint."""

    @property
    def power(self) -> Floats:
        """[T] W."""
        return np.asarray(self.joints.sum(axis=1))


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of all segments, one after another."""

    step_s: float
    time: Floats
    """[T] Unix s."""
    recording: np.ndarray
    """[T] names."""
    P: Floats
    """[T] W measured."""
    moving: np.ndarray
    """[T] whether a joint moves."""
    parts: list[RowsPart]
    segments: Sequence[Segment]
    """The segments of the rows."""

    @property
    def axes(self) -> int:
        """Number of joints."""
        return int(self.parts[0].joints.shape[1]) - 1

    @property
    def predicted(self) -> Floats:
        """[T] W: the sum of all parts."""
        return np.asarray(np.sum([each.power for each in self.parts], axis=0))

    @property
    def residual(self) -> Floats:
        """[T] W, measured minus predicted."""
        return self.P - self.predicted


def rows_of(model: Predictor, bundle: Bundle, path: Path, data: Dataset) -> Rows:
    """Split the predictions of a dataset. Raises UserError where model and dataset do not fit, or for a network."""
    require_parts(model, path)
    if data.axes != model.axes or data.robot != bundle.metadata["robot"]:
        raise UserError(
            f"{data.path} is of {data.robot} with {data.axes} axes, the model of {bundle.metadata['robot']} with "
            f"{model.axes}: use a model of this robot"
        )
    if abs(data.step_s - model.step_s) > 1e-9:
        raise UserError(f"{data.path} has rows of {data.step_s} s, the model of {model.step_s} s; build it again")
    return of_segments(model, sorted(data.segments, key=lambda each: each.start_s))


def require_energy(rows: Rows, path: Path) -> None:
    """Raise UserError for measured power without energy: no share of it can be said."""
    if not rows.P.sum() > 0:
        raise UserError(f"{path}: the measured energy is not positive; check the direction of the current transformers")


def of_segments(model: Predictor, segments: Sequence[Segment]) -> Rows:
    """Rows of segments in their order."""
    split = [parts_of(model, segment) for segment in segments]
    parts = [
        RowsPart(same[0].cause, same[0].name, same[0].term is not None, np.concatenate([each.joints for each in same]))
        for same in zip(*split, strict=True)
    ]
    return Rows(
        model.step_s,
        np.concatenate([each.start_s + model.step_s * np.arange(len(each.P)) for each in segments]),
        np.concatenate([np.full(len(each.P), each.recording) for each in segments]),
        np.concatenate([each.P for each in segments]),
        np.concatenate([moving_rows(each, model.step_s) for each in segments]),
        parts,
        segments,
    )
