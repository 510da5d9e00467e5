"""Energy by what the log says the robot was working on: program, step, part, state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.segments import Segment
from acqd.models.yearly import moving_rows
from acqd.robot.labels import Texts
from acqd.robot.log_layout import LABELS

_J_PER_KWH = 3.6e6
_UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Labelled:
    """All rows with one value of a label."""

    name: str
    seconds: float
    moving: float
    """Share of the rows in which a joint moves."""
    kWh: float
    """Measured."""
    visits: Floats
    """[n] kWh of every unbroken run of rows."""


def names_of(segments: Sequence[Segment], label: str, path: Path) -> list[Texts]:
    """[T] name of the value of every row, of every segment. Raises UserError where no log has the column."""
    if label not in LABELS or not any(label in segment.labels for segment in segments):
        raise UserError(
            f"{path}: its logs have no column {label}; name the column in the robot's description ([[log]] {label} = "
            "..., docs/robots.md) and build the dataset again"
        )
    return [
        _known(segment.labels[label]) if label in segment.labels else np.full(len(segment.P), _UNKNOWN, dtype=object)
        for segment in segments
    ]


def _known(labels: Texts) -> Texts:
    return np.where(labels == "", _UNKNOWN, labels)


def labelled(segments: Sequence[Segment], label: str, step_s: float, path: Path) -> list[Labelled]:
    """Energy by value of a label, in the order in which values appear. Raises UserError as `names_of`."""
    names = names_of(segments, label, path)
    runs: dict[str, list[tuple[float, int, int]]] = {}  # joules, rows, rows in motion
    for segment, each in zip(segments, names, strict=True):
        moving = moving_rows(segment, step_s)
        edges = np.flatnonzero(np.concatenate([[True], each[1:] != each[:-1], [True]]))
        for first, last in pairwise(edges.tolist()):
            run = float(segment.P[first:last].sum()) * step_s, last - first, int(moving[first:last].sum())
            runs.setdefault(str(each[first]), []).append(run)
    return [_of(name, np.array(each), step_s) for name, each in runs.items()]


def _of(name: str, runs: Floats, step_s: float) -> Labelled:
    joules, rows, moving = runs.sum(axis=0)
    return Labelled(
        name, float(rows * step_s), float(moving / rows), float(joules / _J_PER_KWH), runs[:, 0] / _J_PER_KWH
    )
