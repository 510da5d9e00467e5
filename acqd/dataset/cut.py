"""Cuts one long log into short ones, for robots of which only one log exists."""

from __future__ import annotations

import numpy as np

from acqd.robot.log import RobotLog


def cut(log: RobotLog, seconds: float) -> list[RobotLog]:
    """Pieces of about `seconds`; the path of a piece is the log's path and below it the piece's name."""
    span = float(log.time.max() - log.time.min())
    count = max(1, round(span / seconds))
    number = np.minimum(((log.time - log.time.min()) / max(span, 1e-9) * count).astype(int), count - 1)
    pieces = [log.part(number == k, log.path / f"{log.path.stem}_p{k + 1:03d}") for k in range(count)]
    return [piece for piece in pieces if len(piece.time) > 1]  # a piece within a gap of the log has no rows
