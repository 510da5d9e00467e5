"""Cuts one long log into short ones, for robots of which only one log exists."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.robot.log import RobotLog


def cut(log: RobotLog, seconds: float) -> list[RobotLog]:
    """Pieces of about `seconds`; the path of a piece is the log's path and below it the piece's name."""
    span = float(log.time.max() - log.time.min())
    count = max(1, round(span / seconds))
    number = np.minimum(((log.time - log.time.min()) / max(span, 1e-9) * count).astype(int), count - 1)
    pieces = [_piece(log, number == k, log.path / f"{log.path.stem}_p{k + 1:03d}") for k in range(count)]
    return [piece for piece in pieces if len(piece.time) > 1]  # a piece within a gap of the log has no rows


def _piece(log: RobotLog, rows: NDArray[np.bool_], path: Path) -> RobotLog:
    per_axis = {
        name: None if (values := getattr(log, name)) is None else values[rows]
        for name in ("qd", "tau", "current", "temperature")
    }
    signals = {name: values[rows] for name, values in log.signals.items()}
    return replace(log, path=path, time=log.time[rows], q=log.q[rows], **per_axis, signals=signals)
