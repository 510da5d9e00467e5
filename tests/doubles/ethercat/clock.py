"""Time of the segment: the one oscillator that all slave controllers share."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Time of the oscillator in ns, from an arbitrary zero."""

    def now(self) -> int:
        """Time [ns]."""
        ...


class VirtualClock:
    """Clock that only moves when it is told to: the time of a lockstep run."""

    def __init__(self) -> None:
        self._time = 1_000_000_000

    def now(self) -> int:
        """Time [ns]."""
        return self._time

    def advance(self, duration: int) -> None:
        """Let `duration` [ns] pass."""
        self._time += duration


class RealClock:
    """CLOCK_MONOTONIC, faster by `drift_ppm` parts per million."""

    def __init__(self, drift_ppm: float = 0.0) -> None:
        self._origin = self._host = time.monotonic_ns()
        self._ppt = 0
        self.set_drift(drift_ppm)

    def now(self) -> int:
        """Time [ns]."""
        elapsed = time.monotonic_ns() - self._host
        return self._origin + elapsed + elapsed * self._ppt // 1_000_000_000_000

    def set_drift(self, ppm: float) -> None:
        """Change the rate from now on; the time itself does not jump."""
        self._origin, self._host = self.now(), time.monotonic_ns()
        self._ppt = round(ppm * 1_000_000)
