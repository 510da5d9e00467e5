"""Stream time against this computer's clock: when has the clock really stepped, and how does the stream follow?

Time is UTC at the stream's start plus the sample count. The computer's UTC minus that is at most a
little positive (samples are looked at after they were taken), so a step back shows at once and a
step forward when even the smallest difference of a second stays large. Slow drift between the
sampling clock and UTC ends in the same way, as one visible re-anchoring instead of a silent creep.

Time of rows never goes back. A forward step is followed at once. After a step back (a leap second, a
correction by NTP) the stream's time runs at half speed until the clock has caught up with it. A step back by
more than `ABSORBED_NS` is a clock that was wrong before: the stream follows at once, and the daemon gives the
rows from there on another boot.
"""

from __future__ import annotations

from collections import deque

STEP_NS = 100_000_000
"""Differences beyond 0.1 s are steps."""
ABSORBED_NS = 10_000_000_000
"""Steps back by up to 10 s are absorbed, which takes twice as long."""
_WINDOWS = 25  # one second


class StepDetector:
    """Feed it once per window."""

    def __init__(self, window_ns: int = 40_000_000) -> None:
        self._recent: deque[int] = deque(maxlen=_WINDOWS)
        self._most_ns = window_ns // 2  # that a window's time may be shorter than the window
        self._absorbing = False

    def check(self, utc_ns: int, stream_ns: int) -> int | None:
        """The offset to add to the stream's time [ns] when the clock has stepped, else None."""
        difference = utc_ns - stream_ns
        self._recent.append(difference)
        if difference >= 0:
            self._absorbing = False
        if difference < -STEP_NS or self._absorbing:
            self._recent.clear()
            self._absorbing = difference >= -ABSORBED_NS
            return max(difference, -self._most_ns) if self._absorbing else difference
        smallest = min(self._recent)
        if len(self._recent) < _WINDOWS or smallest <= STEP_NS:
            return None
        self._recent.clear()
        return smallest
