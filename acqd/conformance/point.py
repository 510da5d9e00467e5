"""A test point: signal, limit, result."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Limit:
    """What a standard allows, and where the number is from."""

    value: float
    unit: str
    source: str


@dataclass(frozen=True, slots=True)
class Point:
    """The result of one test point."""

    standard: str
    parameter: str
    signal: str
    quantity: str
    """What is compared, in words."""
    limit: Limit
    error: float
    """Largest absolute error of all readings, in the unit of the limit; NaN where a reading is missing."""
    readings: int

    @property
    def passed(self) -> bool:
        """Whether there are readings, and all of them are within the limit."""
        return self.readings > 0 and bool(self.error <= self.limit.value)

    @property
    def used(self) -> float:
        """Share of the limit that the error takes; infinite where it is not known."""
        if not np.isfinite(self.error) or not self.readings:
            return float("inf")
        return self.error / self.limit.value if self.limit.value > 0 else float(self.error > 0)

    def as_json(self) -> dict[str, Any]:
        """Plain data; an unknown error is null."""
        return {
            "standard": self.standard, "parameter": self.parameter, "signal": self.signal, "quantity": self.quantity,
            "limit": self.limit.value, "unit": self.limit.unit, "source": self.limit.source,
            "error": self.error if np.isfinite(self.error) else None, "readings": self.readings, "passed": self.passed,
        }  # fmt: skip


def judged(standard: str, parameter: str, signal: str, quantity: str, limit: Limit, errors: Iterable[Any]) -> Point:
    """The point of these errors: numbers or arrays, in the unit of the limit. A missing reading fails the point."""
    flat = np.concatenate([np.zeros(0), *(np.ravel(np.asarray(one, dtype=np.float64)) for one in errors)])
    worst = float(np.abs(flat).max()) if len(flat) else float("nan")
    return Point(standard, parameter, signal, quantity, limit, worst, len(flat))
