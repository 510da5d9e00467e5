"""Oscillation that a network makes by itself (thesis Figure 8.5)."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.segments import Segment

_WINDOW = 25  # rows
_TIMES = 4.0  # as restless as the measurement
_LEAST_W = 2.0


def unstable_share(predicted: list[Floats], segments: list[Segment]) -> float:
    """Share of seconds in which the prediction's second difference is far above that of the measured power."""
    flagged = total = 0
    for guess, segment in zip(predicted, segments, strict=True):
        restless, true = _restlessness(guess), _restlessness(segment.P)
        typical = float(np.percentile(true, 90)) if len(true) else 0.0
        flagged += int((restless > np.maximum(_TIMES * np.maximum(true, typical), _LEAST_W)).sum())
        total += len(restless)
    return flagged / max(total, 1)


def _restlessness(P: Floats) -> Floats:
    """RMS of the second difference in windows of a second [W]."""
    bend = np.diff(P, 2)
    count = len(bend) // _WINDOW
    return np.asarray(np.sqrt((bend[: count * _WINDOW].reshape(count, _WINDOW) ** 2).mean(axis=1)))
