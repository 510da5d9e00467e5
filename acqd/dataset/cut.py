"""Cuts long logs into pieces, for robots of which few logs exist."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.resample import resampled
from acqd.errors import InputError
from acqd.robot.log import RobotLog, in_time

AUTO: Literal["auto"] = "auto"
"""As length: choose it from the logs."""
CONTEXT_ROWS = 12
"""Rows of the dataset before and after a piece that give its first and last rows their motion.

More than any model looks back or ahead (networks: 10).
"""
_PIECES = 20  # pieces that a split of 74, 12 and 14 % fills well: 15, 2 and 3
SHORTEST_S = 5.0
"""Shorter pieces have too few rows for the loop's noise model, which needs 120."""
_LONGEST_S = 60.0  # warm-up and drift need many pieces
_SLACK = 0.25  # share of a piece by which its length may differ, so that cuts lie in rests
_GRID_S = 0.04
_REST = 0.02  # of the speed limits


def automatic_length(logs: list[RobotLog]) -> float:
    """Usual length of a piece [s]: enough pieces for a split, none too short for the loop's noise model."""
    total_s = sum(float(np.ptp(in_time(log)[0])) for log in logs)
    return float(np.clip(total_s / _PIECES, SHORTEST_S / (1 - _SLACK), _LONGEST_S / (1 + _SLACK)))


def cut(log: RobotLog, seconds: float, step_s: float) -> list[RobotLog]:
    """Pieces of equal length, about `seconds`; the path of a piece is the log's path and below it the piece's name.

    Each piece has its span as `core`, and rows of the log before and after it. Raises InputError from the log's clock.
    """
    time, _ = in_time(log)
    count = max(1, round(float(np.ptp(time)) / seconds))
    return _pieces(log, np.linspace(time[0], time[-1], count + 1), step_s)


def cut_at_rests(log: RobotLog, seconds: float, step_s: float, speed_limit: Floats) -> tuple[list[RobotLog], int]:
    """Pieces of about `seconds`, cut where the arm is slowest, and the number of cuts in motion.

    Lengths differ by a quarter at most. `speed_limit` [axes] rad/s. Raises InputError from the log's clock.
    """
    time, rows = in_time(log)
    span = float(np.ptp(time))
    count = max(1, int(span / seconds), int(np.ceil(span / _LONGEST_S)) if span > _LONGEST_S else 1)
    length = span / count
    grid = np.arange(time[0], time[-1], _GRID_S)
    q = np.column_stack([resampled(grid, time, angle, _GRID_S) for angle in log.q[rows].T])
    speed = (np.abs(np.gradient(q, _GRID_S, axis=0)) / speed_limit).max(axis=1) if len(grid) > 1 else np.zeros(1)
    edges, moving = [float(time[0])], 0
    for number in range(1, count):
        middle = time[0] + number * length
        near = np.flatnonzero(np.abs(grid - middle) <= _SLACK / 2 * length)
        # of equally slow places the nearest one
        best = near[np.lexsort((np.abs(grid[near] - middle), np.maximum(speed[near], _REST)))[0]]
        edges.append(float(grid[best]))
        moving += bool(speed[best] > _REST)
    return _pieces(log, np.array([*edges, time[-1]]), step_s), moving


def _pieces(log: RobotLog, edges: Floats, step_s: float) -> list[RobotLog]:
    margin = CONTEXT_ROWS * step_s
    pieces = []
    for number, (start, end) in enumerate(pairwise(edges.tolist()), 1):
        last = number == len(edges) - 1
        core = (log.time >= start) & ((log.time <= end) if last else (log.time < end))
        if core.sum() < 2:
            continue  # within a gap of the log
        rows = (log.time >= start - margin) & (log.time <= end + margin)
        piece = log.part(rows, log.path / f"{log.path.stem}_p{number:03d}")
        pieces.append(replace(piece, core=(start, end)))
    if not pieces:
        raise InputError(log.path, "no piece has two rows")
    return pieces
