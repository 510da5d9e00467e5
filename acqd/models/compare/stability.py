"""Oscillation of predictions that the measured power does not show (thesis Figure 8.5)."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.segments import Segment

_WINDOW = 25  # rows, one second
_RATIO = 4.0  # of the predicted to the measured second difference
_MIN_W = 2.0


def unstable_share(predicted: list[Floats], segments: list[Segment]) -> float:
    """Share of seconds in which a prediction has more than four times the second difference of the measurement.

    The measurement counts in that second or in the 90th percentile of its segment, whichever is larger.
    """
    flagged = total = 0
    for power, segment in zip(predicted, segments, strict=True):
        bend, measured = _second_difference(power), _second_difference(segment.P)
        typical = float(np.percentile(measured, 90)) if len(measured) else 0.0
        flagged += int((bend > np.maximum(_RATIO * np.maximum(measured, typical), _MIN_W)).sum())
        total += len(bend)
    return flagged / max(total, 1)


def _second_difference(P: Floats) -> Floats:
    """RMS of the second difference in W, in windows of one second."""
    bend = np.diff(P, 2)
    count = len(bend) // _WINDOW
    return np.asarray(np.sqrt((bend[: count * _WINDOW].reshape(count, _WINDOW) ** 2).mean(axis=1)))
