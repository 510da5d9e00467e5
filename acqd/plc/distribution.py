"""Times in classes of 1, 2 and 5 per decade: what a histogram and Prometheus show of many cycles."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

UPPER_US = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000, 10_000, 20_000, 50_000)
"""Upper limits of the classes [us]; one more class has everything above."""


@dataclass(frozen=True, slots=True)
class Distribution:
    """How many times fell into which class."""

    upper_us: tuple[int, ...]
    counts: tuple[int, ...]
    """One more than limits: the last is of everything above."""
    sum_us: float


class Durations:
    """Counts durations as they come; written by one thread and readable by others."""

    def __init__(self) -> None:
        self._counts = [0] * (len(UPPER_US) + 1)
        self._sum_ns = 0

    def add(self, duration_ns: int) -> None:
        """One cycle."""
        self._counts[bisect_left(UPPER_US, duration_ns / 1000)] += 1
        self._sum_ns += duration_ns

    def distribution(self) -> Distribution:
        """The counts so far."""
        return Distribution(UPPER_US, tuple(self._counts), self._sum_ns / 1000)


def of_microseconds(histogram: NDArray[np.int64], sum_us: float) -> Distribution:
    """Classes of a histogram with bins of 1 us (bin k: k to k + 1 us; the last also has everything above)."""
    limits = tuple(limit for limit in UPPER_US if limit < len(histogram))
    counts = np.add.reduceat(histogram, (0, *limits))
    return Distribution(limits, tuple(counts.tolist()), sum_us)


def together(parts: Iterable[Distribution | None]) -> Distribution | None:
    """Sum of distributions with the same limits; None for an empty list."""
    every = [part for part in parts if part is not None]
    if not every:
        return None
    counts = tuple(map(sum, zip(*(part.counts for part in every), strict=True)))
    return Distribution(every[0].upper_us, counts, sum(part.sum_us for part in every))
