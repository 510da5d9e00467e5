"""When to try a lost device again."""

from __future__ import annotations

import random


class Backoff:
    """Exponential back-off with jitter, so that many clients of one device do not come back together."""

    def __init__(self, first_ns: int = 500_000_000, longest_ns: int = 8_000_000_000) -> None:
        self._first_ns = first_ns
        self._longest_ns = longest_ns
        self._pause_ns = first_ns
        self.next_ns = 0
        """When the next try is due."""

    def due(self, now_ns: int) -> bool:
        """Whether it is time for the next try; asking after it has come starts a longer pause."""
        if now_ns < self.next_ns:
            return False
        self.next_ns = now_ns + round(self._pause_ns * random.uniform(0.75, 1.0))
        self._pause_ns = min(2 * self._pause_ns, self._longest_ns)
        return True

    def reset(self) -> None:
        """The device is back."""
        self._pause_ns, self.next_ns = self._first_ns, 0
