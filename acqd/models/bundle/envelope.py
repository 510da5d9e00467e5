"""Range of motion in the training data, to flag predictions outside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.features import motion

if TYPE_CHECKING:
    from acqd.models.segments import Segment

_SLACK = 0.05  # of the width of a range: tolerance on either side
_NAMES = ("q_rad", "qd_rad_s", "qdd_rad_s2")


@dataclass(frozen=True, slots=True)
class Envelope:
    """Lowest and highest angle, velocity and acceleration per axis."""

    low: Floats
    """[3, axes]: q rad, qd rad/s, qdd rad/s^2."""
    high: Floats
    """[3, axes]."""

    @classmethod
    def of(cls, segments: list[Segment], step_s: float) -> Envelope:
        """Ranges of training segments."""
        moved = [np.concatenate(parts) for parts in zip(*(s.motion(step_s) for s in segments), strict=True)]
        return cls(np.array([x.min(axis=0) for x in moved]), np.array([x.max(axis=0) for x in moved]))

    def outside(self, q: Floats, step_s: float) -> NDArray[np.bool_]:
        """[T], True for rows of `q` [T, axes] rad with an angle, velocity or acceleration outside the ranges."""
        slack = _SLACK * (self.high - self.low) + 1e-9
        rows = np.zeros(len(q), dtype=bool)
        for order, values in enumerate(motion(q, step_s)):
            rows |= ((values < self.low[order] - slack[order]) | (values > self.high[order] + slack[order])).any(axis=1)
        return rows

    def as_json(self) -> dict[str, Any]:
        """The entry of bundle.json."""
        return {n: {"low": self.low[k].tolist(), "high": self.high[k].tolist()} for k, n in enumerate(_NAMES)}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Envelope:
        """The inverse of `as_json`. Raises KeyError, TypeError, ValueError for anything else."""
        low, high = (np.array([data[n][end] for n in _NAMES], dtype=np.float64) for end in ("low", "high"))
        if low.ndim != 2 or low.shape != high.shape:
            raise ValueError(f"an envelope of the shapes {low.shape} and {high.shape}")
        return cls(low, high)
