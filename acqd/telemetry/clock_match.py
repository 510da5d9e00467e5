"""Whether the clocks of sinks agree with this computer's: their receipts say what time it is there."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from datetime import datetime

from acqd.timestamps import rfc3339

_AGREE_S = 60.0
"""A receipt comes within a second; nobody who meters cares for less."""
_LATELY_S, _SPAN_S = 30.0, 5.0
"""Receipts that count, and the time between the first and the last of them before anything is said: one may be late."""
_MOST = 256
_LAST_S = 253_402_214_400
"""The last day of 9999. A clock that was never set shows 1970 or later, one with a broken battery 2099 or 2106."""


class ClockMatch:
    """Of the receipts of the last 30 s; for one thread."""

    def __init__(self, now_ns: Callable[[], int] = time.time_ns, elapsed: Callable[[], float] = time.monotonic) -> None:
        self._now_ns, self._elapsed = now_ns, elapsed
        self._heard: deque[tuple[float, float, str]] = deque(maxlen=_MOST)

    def heard(self, sink: str, text: str) -> None:
        """A receipt and the time (RFC 3339) at which the sink has sent it; what is no time is ignored."""
        try:
            there_s = datetime.fromisoformat(text).timestamp()
        except (ValueError, OverflowError, OSError):
            return
        if not 0 <= there_s < _LAST_S:
            return
        self._heard.append((self._elapsed(), there_s - self._now_ns() / 1e9, sink))

    @property
    def trouble(self) -> str:
        """Which clock differs by more than a minute from all receipts of late, else empty."""
        now = self._elapsed()
        while self._heard and now - self._heard[0][0] > _LATELY_S:
            self._heard.popleft()
        if not self._heard or self._heard[-1][0] - self._heard[0][0] < _SPAN_S:
            return ""
        _, ahead_s, sink = min(self._heard, key=lambda one: abs(one[1]))
        if abs(ahead_s) <= _AGREE_S:
            return ""
        here = self._now_ns()
        there = rfc3339(here + round(ahead_s * 1e9), 0)
        return (
            f"this computer's clock says {rfc3339(here, 0)}, that of sink {sink[:64]} {there}: set the wrong one "
            "(chrony, timedatectl)"
        )
