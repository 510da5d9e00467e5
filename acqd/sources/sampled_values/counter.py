"""smpCnt wraps every second: from its values to a counter that does not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_DISAGREEMENT_S = 0.05
"""A jump of smpCnt that the arrival times contradict by more than this: the counter was set."""


class SecondCounter:
    """Unwraps a counter that runs from 0 to `rate` - 1 each second."""

    def __init__(self, rate: int) -> None:
        self._rate = rate
        self._last: int | None = None
        self._last_ns = 0
        self.was_set = False
        """Whether the counter of the last call was set, as by a merging unit that finds its time pulse."""

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
        self.was_set = self._contradicted(first, first_ns)
        highest = int(numbers.max())
        self._last = highest if self._last is None or self.was_set else max(highest, self._last)
        self._last_ns = first_ns + round((self._last - first) * 1e9 / rate)
        return np.asarray(numbers)

    def settings_in(self, wrapped: NDArray[np.int64], span_ns: int) -> list[int]:
        """Positions at which the counter was set, among values that arrived within `span_ns`: cut there first."""
        rate, half = self._rate, self._rate // 2
        steps = (np.diff(wrapped) + half) % rate - half
        most = rate * (span_ns * 1e-9 + _DISAGREEMENT_S)
        return [int(k) + 1 for k in np.flatnonzero((steps > most) | (steps < -_DISAGREEMENT_S * rate))]

    def _expected(self, now_ns: int) -> int:
        """Number of a sample that arrives at `now_ns`."""
        assert self._last is not None
        return self._last + max(1, round((now_ns - self._last_ns) * 1e-9 * self._rate))

    def _first(self, value: int, now_ns: int) -> int:
        if self._last is None:
            return value
        half, expected = self._rate // 2, self._expected(now_ns)
        return expected + (value - expected + half) % self._rate - half

    def _contradicted(self, first: int, now_ns: int) -> bool:
        """Whether the counter jumps although the samples arrive without a break, or the other way round."""
        if self._last is None or -_DISAGREEMENT_S * self._rate < first - self._last <= 1:
            return False  # the next sample, a copy, or one that was overtaken
        return abs(first - self._expected(now_ns)) > _DISAGREEMENT_S * self._rate


class RateCheck:
    """Whether smpCnt counts as many samples a second as the rate says."""

    def __init__(self, rate: int) -> None:
        self._rate = rate
        self._last: int | None = None
        self._wraps: list[int] = []

    def contradiction(self, wrapped: NDArray[np.int64]) -> str:
        """What contradicts the rate; empty: nothing so far. One odd wrap may be a lost frame, two equal ones not."""
        highest = int(wrapped.max())
        if highest >= self._rate:
            return f"smpCnt reaches {highest}, source.rate says {self._rate} samples/s; correct source.rate"
        values = wrapped if self._last is None else np.concatenate(([self._last], wrapped))
        self._last = int(wrapped[-1])
        self._wraps += (values[:-1][np.diff(values) < -self._rate // 2] + 1).tolist()
        self._wraps = self._wraps[-2:]
        if len(self._wraps) == 2 and self._wraps[0] == self._wraps[1] != self._rate:
            return f"smpCnt wraps at {self._wraps[0]}, source.rate says {self._rate} samples/s; correct source.rate"
        return ""
