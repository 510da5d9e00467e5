"""Does a meter show more current than the fuse in front of it lets through? Then its transformer ratio is wrong.

A ratio scales I, P and S together, so no register contradicts another: only the rated current of the circuit tells.
It is not known whether a fuse or a circuit breaker carries it, so the current must be one that neither does. At the
latest, a circuit breaker trips at 1.45 times its rated current within one hour, of more than 63 A two hours; at 2.55
times within one minute, of more than 32 A two minutes; type D at 20 times at once (IEC 60898-1). A gG fuse melts at 1.6
times within one to four hours, at 1.9 times below 16 A and at 2.1 times up to 4 A (IEC 60269-1 and -2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

_AT_ONCE = 20.0
"""Times the rated current: what type D trips at within 0.1 s."""
_SHORT = (120.0, 4.0)
"""Seconds, and times the rated current on average, that no gG fuse up to 400 A carries: between 7 times for 5 s and 1.6
times for three hours, on logarithmic scales."""
_LONGEST_S = 60.0
"""Between two rounds: in longer pauses the current is not known."""


def _carried(rated: float) -> tuple[tuple[float, float], ...]:
    """Seconds, and times the rated current on average, that no fuse and no circuit breaker carries."""
    times = next((times for most, times in ((4.0, 2.1), (15.9, 1.9)) if rated <= most), 1.6)
    hours = next((hours for most, hours in ((63.0, 1), (160.0, 2), (400.0, 3)) if rated <= most), 4)
    return _SHORT, (3600.0 * hours, times)


@dataclass(slots=True)
class RatedCurrent:
    """Of one meter; says nothing without a rated current [A]."""

    rated: float | None = None
    remark: str = ""
    _last_ns: int | None = None
    _sums: dict[tuple[str, float], tuple[float, float]] = field(default_factory=dict)
    """Ampere seconds and seconds of each phase, for each time of `_carried`."""

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
        for length, times in _carried(self.rated):
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
