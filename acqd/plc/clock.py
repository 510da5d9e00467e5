"""Stream time against this computer's clock: when has the clock really stepped?

Time is UTC at the stream's start plus the sample count. The computer's UTC minus that is at most a
little positive (samples are looked at after they were taken), so a step back shows at once and a
step forward when even the smallest difference of a second stays large. Slow drift between the
sampling clock and UTC ends in the same way, as one visible re-anchoring instead of a silent creep.
"""

from __future__ import annotations

from collections import deque

STEP_NS = 100_000_000
"""Differences beyond 0.1 s are steps."""
_WINDOWS = 25  # one second


class StepDetector:
    """Feed it once per window."""

    def __init__(self) -> None:
        self._recent: deque[int] = deque(maxlen=_WINDOWS)

    def check(self, utc_ns: int, stream_ns: int) -> int | None:
        """The offset to add to the stream's time [ns] when the clock has stepped, else None."""
        self._recent.append(utc_ns - stream_ns)
        smallest = min(self._recent)
        back = self._recent[-1] < -STEP_NS
        forward = len(self._recent) == _WINDOWS and smallest > STEP_NS
        if not back and not forward:
            return None
        self._recent.clear()
        return utc_ns - stream_ns if back else smallest
