"""What the command line prints beside a result, as warnings; doubts about arrays of angles and power."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from acqd.arrays import Floats
    from acqd.dataset.merge import Recording
    from acqd.robot.description import RobotDescription

_FEWEST_COPIES = 3
"""Rows: a recorder may write one again."""
_CALLER = 3
"""Of the public function that hands its lines on."""


def warn_of(lines: Iterable[str]) -> None:
    """One UserWarning for each line, at the line of code that called the public function."""
    for line in lines:
        if line:
            warnings.warn(line, UserWarning, stacklevel=_CALLER)


def doubtful_power(y: Floats, robot: RobotDescription) -> Iterator[str]:
    """A line on power [T] W that flows out of the robot, or is in another unit: a table with it is refused."""
    from acqd.dataset.log_power import LEAST_W
    from acqd.dataset.power_values import large_power

    usual = float(np.median(y)) if len(y) else 0.0
    if len(y) > 1 and np.ptp(y) == 0.0:
        yield f"the power is {usual:g} W in all rows: is this the robot's power?"
    elif large := large_power(y, robot):
        yield large
    elif usual < 0:
        yield f"the power is {usual:.3g} W in the median: is its sign inverted?"
    elif len(y) and np.percentile(y, 95) < LEAST_W:
        yield f"the power is below {LEAST_W:g} W in 95 % of the rows: is it in kW? expected W"


def scaled(q: Floats) -> Iterator[str]:
    """A line on angles [T, axes] that are rounded, or scaled by a pipeline: to mean 0 and deviation 1, or to 0..1."""
    moved = q[:, np.ptp(q, axis=0) > 0] if len(q) else q
    if moved.size and np.array_equal(moved, np.round(moved)):
        yield "all angles are whole numbers: are they rounded, or in degrees? Expected rad with decimals"
        return
    if moved.shape[1] < 2:
        return
    standard = np.allclose(moved.mean(axis=0), 0.0, atol=1e-6) and np.allclose(moved.std(axis=0), 1.0, atol=1e-6)
    ranged = np.allclose(moved.min(axis=0), 0.0, atol=1e-9) and np.allclose(moved.max(axis=0), 1.0, atol=1e-9)
    if standard or ranged:
        how = "mean 0 and deviation 1" if standard else "the range 0 to 1"
        yield f"all angles have {how}: has a scaler changed them? The robot's physics needs rad: leave the scaler out"


def written_twice(X: Floats, y: Floats, recordings: Sequence[Recording]) -> Iterator[str]:
    """A line on rows that repeat the row before, in angles and power, while the arm moves on.

    A meter that is slower than the rows repeats power, a slow controller or a coarse encoder repeats angles: each by
    itself. Where rows are written twice, power repeats in most rows that repeat the angles, and in few others.
    """
    ends = np.cumsum([len(each.valid) for each in recordings])
    moves = np.concatenate([[False], (X[1:] != X[:-1]).any(axis=1), [False]])  # into each row, and after the last
    stays = np.concatenate([[False], y[1:] == y[:-1]])
    again = np.concatenate([[False], moves[:-2]]) & ~moves[:-1] & moves[1:]
    again[ends[:-1]] = False
    rows = np.flatnonzero(again & stays)
    together = len(rows) > again.sum() / 2 and stays[moves[:-1]].sum() < moves.sum() / 2
    if len(rows) >= _FEWEST_COPIES and np.ptp(y) > 0.0 and together:
        yield (
            f"{len(rows)} rows repeat the row before while the arm moves, the first is row {int(rows[0]) + 1}: are "
            "they written twice? Rows are step_s apart: drop the copies"
        )
