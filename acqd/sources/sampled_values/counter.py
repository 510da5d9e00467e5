"""smpCnt wraps every second: from its values to a counter that does not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class SecondCounter:
    """Unwraps a counter that runs from 0 to `rate` - 1 each second."""

    def __init__(self, rate: int) -> None:
        self._rate = rate
        self._last: int | None = None
        self._last_ns = 0

    def unwrap(self, wrapped: NDArray[np.int64], first_ns: int) -> NDArray[np.int64]:
        """Sample numbers of consecutive values; `first_ns` is the arrival time of the first [monotonic ns].

        Neighbours in arrival are neighbours in time: of all numbers that give the same value, the
        nearest counts (a frame that another has overtaken lies before its predecessor). Only
        between two calls can more than half a second be missing; the arrival time tells how much.
        """
        rate, half = self._rate, self._rate // 2
        steps = (np.diff(wrapped) + half) % rate - half
        first = self._first(int(wrapped[0]), first_ns)
        numbers = first + np.concatenate(([0], np.cumsum(steps)))
        self._last = max(int(numbers.max()), first if self._last is None else self._last)
        self._last_ns = first_ns + round((self._last - first) * 1e9 / rate)
        return np.asarray(numbers)

    def _first(self, value: int, now_ns: int) -> int:
        if self._last is None:
            return value
        half = self._rate // 2
        elapsed = round((now_ns - self._last_ns) * 1e-9 * self._rate)
        expected = self._last + max(1, elapsed)
        return expected + (value - expected + half) % self._rate - half
