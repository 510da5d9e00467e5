"""A robot's log: joint angles over the controller's clock, and whatever else the controller recorded."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.robot.labels import Texts
from acqd.robot.motion_quality import MotionQuality

DAY_S = 86_400.0
"""No recording is longer."""


@dataclass(frozen=True, slots=True)
class RobotLog:
    """One recording with the rows of the file: not resampled, not sorted; a few garbled rows may be left out."""

    path: Path
    time: Floats
    """[T] s of the controller's clock, counted from 1970 or from any other origin."""
    q: Floats
    """[T, axes] rad."""
    qd: Floats | None = None
    """[T, axes] rad/s."""
    tau: Floats | None = None
    """[T, axes] Nm."""
    current: Floats | None = None
    """[T, axes] A."""
    temperature: Floats | None = None
    """[T, axes] degC."""
    signals: dict[str, Floats] = field(default_factory=dict)
    """`tool` and `brake` [T], 0 or 1, where recorded (brake 1: open)."""
    labels: dict[str, Texts] = field(default_factory=dict)
    """`program`, `step`, `part` and `state` [T], where recorded."""
    power: Floats | None = None
    """[T] W, measured by the controller: the logged power, or voltage times current of the supply."""
    voltage: Floats | None = None
    """[T] V at the robot's supply, where the controller measures it."""
    core: tuple[float, float] | None = None
    """Of a piece of a log: the span [s] that is the piece; rows outside it tell how the arm came and went."""
    note: str = ""
    """Which garbled rows were left out, and why; empty if none."""
    quality: MotionQuality = field(default=MotionQuality())
    """What was found in the motion, and left out or mended."""

    def part(self, rows: NDArray[np.bool_] | NDArray[np.int64], path: Path) -> RobotLog:
        """Some rows as a log of the name `path`."""
        names = ("time", "q", "qd", "tau", "current", "temperature", "power", "voltage")
        values: dict[str, Any] = {
            name: None if (column := getattr(self, name)) is None else column[rows] for name in names
        }
        signals = {name: column[rows] for name, column in self.signals.items()}
        labels = {name: column[rows] for name, column in self.labels.items()}
        return replace(self, path=path, signals=signals, labels=labels, **values)


def in_time(log: RobotLog) -> tuple[Floats, NDArray[np.int64]]:
    """The distinct times in rising order, and the row of each. Raises InputError for a jump of more than a day."""
    order = np.argsort(log.time, kind="stable")
    stamps, first = np.unique(log.time[order], return_index=True)
    rows = np.asarray(order[first], dtype=np.int64)
    steps = np.diff(stamps)
    if len(steps) and steps.max() > DAY_S:
        row = int(rows[int(steps.argmax())]) + 1
        raise InputError(
            log.path, f"time jumps by {steps.max() / DAY_S:.0f} days after data row {row}: remove the wrong rows"
        )
    return stamps, rows


def require_rising(log: RobotLog) -> None:
    """Raises InputError when the time does not rise from row to row: for uses that cannot sort or drop rows."""
    wrong = np.flatnonzero(np.diff(log.time) <= 0)
    if len(wrong):
        row = int(wrong[0]) + 1
        raise InputError(
            log.path,
            f"time goes from {log.time[row - 1]:.6f} s to {log.time[row]:.6f} s at data row {row + 1} "
            f"({len(wrong)} such rows); expected rising time: sort the rows and drop duplicates",
        )
