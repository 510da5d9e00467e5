"""What a model has seen in training, so that predictions beyond it can be flagged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.features import motion

if TYPE_CHECKING:
    from acqd.models.segments import Segment

_SLACK = 0.05  # of a range's width: a hair's breadth outside is still inside
_NAMES = ("q_rad", "qd_rad_s", "qdd_rad_s2")


@dataclass(frozen=True, slots=True)
class Envelope:
    """Ranges per axis."""

    low: Floats
    """[3, axes]: q, qd, qdd."""
    high: Floats
    """[3, axes]."""

    @classmethod
    def of(cls, segments: list[Segment], step_s: float) -> Envelope:
        """Of training data."""
        seen = [np.concatenate(parts) for parts in zip(*(motion(s.q, step_s) for s in segments), strict=True)]
        return cls(np.array([each.min(axis=0) for each in seen]), np.array([each.max(axis=0) for each in seen]))

    def outside(self, q: Floats, step_s: float) -> NDArray[np.bool_]:
        """[T]: rows whose angle, velocity or acceleration lies beyond what was seen."""
        slack = _SLACK * (self.high - self.low) + 1e-9
        rows = np.zeros(len(q), dtype=bool)
        for order, values in enumerate(motion(q, step_s)):
            rows |= ((values < self.low[order] - slack[order]) | (values > self.high[order] + slack[order])).any(axis=1)
        return rows

    def as_json(self) -> dict[str, Any]:
        """For bundle.json."""
        return {n: {"low": self.low[k].tolist(), "high": self.high[k].tolist()} for k, n in enumerate(_NAMES)}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Envelope:
        """Back from bundle.json."""
        return cls(np.array([data[n]["low"] for n in _NAMES]), np.array([data[n]["high"] for n in _NAMES]))
