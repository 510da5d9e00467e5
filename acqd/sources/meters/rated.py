"""Does a meter show more current than the fuse in front of it lets through? Then its transformer ratio is wrong.

A ratio scales I, P and S together, so no register contradicts another: only the rated current of the circuit tells.
How long a fuse or a circuit breaker carries what is in IEC 60898-1 and IEC 60269-1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

_AT_ONCE = 20.0
"""Times the rated current: what type D trips at within 0.1 s."""
_CARRIED = ((120.0, 2.55), (3600.0, 1.45))
"""Seconds, and times the rated current on average that trip in that time at the latest."""
_LONGEST_S = 60.0
"""Between two rounds: of longer ones the current is not known."""


@dataclass(slots=True)
class RatedCurrent:
    """Of one meter; says nothing without a rated current [A]."""

    rated: float | None = None
    remark: str = ""
    _last_ns: int | None = None
    _sums: dict[tuple[str, float], tuple[float, float]] = field(default_factory=dict)
    """Ampere seconds and seconds of each phase, for each time of `_CARRIED`."""

    def feed(self, values: Mapping[str, float | None], now_ns: int) -> str:
        """The next round; what is new to say, else empty."""
        last, self._last_ns = self._last_ns, now_ns
        if self.rated is None:
            return ""
        seconds = 0.0 if last is None else (now_ns - last) * 1e-9
        if not 0 <= seconds <= _LONGEST_S:
            self._sums.clear()
            seconds = 0.0
        said = ""
        for phase in ("L1", "L2", "L3"):
            current = values.get(f"{phase}.Irms")
            if current is not None:
                said = said or self._judged(phase, current, seconds)
        new = said if said and not self.remark else ""
        self.remark = self.remark or said
        return new

    def _judged(self, phase: str, current: float, seconds: float) -> str:
        assert self.rated is not None
        said = self._words(phase, current, "now") if current > _AT_ONCE * self.rated else ""
        for length, times in _CARRIED:
            total, passed = self._sums.get((phase, length), (0.0, 0.0))
            total, passed = total + current * seconds, passed + seconds
            if passed >= length:
                if total > times * self.rated * passed:
                    said = said or self._words(phase, total / passed, f"for {passed / 60:.0f} minutes")
                total = passed = 0.0
            self._sums[phase, length] = total, passed
        return said

    def _words(self, phase: str, current: float, time: str) -> str:
        return (
            f"{phase} carries {current:.4g} A {time}, which its fuse does not (rated_current = {self.rated:g} A): "
            "is the ratio of the current transformers that of their nameplates"
        )
