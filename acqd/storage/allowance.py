"""How many bytes of malformed messages a sink keeps: a token bucket, so that a flood of them cannot fill the disk."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

MALFORMED_BYTES_PER_DAY = 32 << 20
"""What a sink keeps unless its settings say otherwise."""
_ENTRY_BYTES = 400
"""Topic, reason, hash and index of an entry, without its payload."""
_DAY_S = 86_400.0


class Allowance:
    """One day's bytes may be used at once; they come back over a day."""

    def __init__(self, bytes_per_day: float, clock: Callable[[], float] = time.monotonic) -> None:
        """`clock` returns seconds."""
        self._most, self._clock = bytes_per_day, clock
        self._left, self._at = bytes_per_day, clock()

    def fitting(self, sizes: Sequence[int]) -> int:
        """How many of the first payloads, of `sizes` bytes, may be kept now."""
        now = self._clock()
        self._left = min(self._most, self._left + self._most * (now - self._at) / _DAY_S)
        self._at = now
        left = self._left
        for count, size in enumerate(sizes):
            left -= size + _ENTRY_BYTES
            if left < 0:
                return count
        return len(sizes)

    def spend(self, sizes: Sequence[int]) -> None:
        """These payloads are kept."""
        self._left -= sum(sizes) + _ENTRY_BYTES * len(sizes)
