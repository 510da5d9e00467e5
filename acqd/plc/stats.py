"""Cycle statistics like cyclictest's: wake-up latency histogram, missed and exceeded cycles."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

BINS = 2_000
"""Histogram bins of 1 us; the last counts everything later."""
_LATE_SHARE = 0.5  # of a period: a wake-up this late is counted as late
SLOTS = BINS + 8
"""int64 slots the counters take, so that they can live in shared memory."""
_CYCLES, _MISSED, _EXCEEDED, _LATE, _SUM, _MIN, _MAX, _BUSY = range(BINS, SLOTS)


@dataclass(frozen=True, slots=True)
class CycleSummary:
    """Latencies in microseconds."""

    period_us: float
    cycles: int
    min_us: int
    mean_us: float
    p50_us: int
    p99_us: int
    p999_us: int
    max_us: int
    late: int
    """Wake-ups later than half a period."""
    missed: int
    """Timer expiries that were missed (their samples were caught up)."""
    exceeded: int
    """Cycles whose work took longer than a period."""
    overflow: int
    """Wake-ups beyond the histogram."""
    busy: float
    """Share of the time spent working."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


class CycleStats:
    """Counters in an int64 array of SLOTS, written by one thread and readable by others."""

    def __init__(self, slots: memoryview[int] | NDArray[np.int64], period_ns: int) -> None:
        self._slots = slots
        self._period_ns = period_ns
        self._late_ns = int(_LATE_SHARE * period_ns)

    def clear(self) -> None:
        """Start from nothing."""
        for slot in range(SLOTS):
            self._slots[slot] = 0
        self._slots[_MIN] = 2**62

    def record(self, latency_ns: int, expirations: int, busy_ns: int) -> None:
        """One cycle: how late it woke, how many periods had passed, how long it worked."""
        slots = self._slots
        latency = max(latency_ns, 0) // 1000
        slots[min(latency, BINS - 1)] += 1
        slots[_CYCLES] += 1
        slots[_SUM] += latency
        slots[_BUSY] += busy_ns
        if latency < slots[_MIN]:
            slots[_MIN] = latency
        if latency > slots[_MAX]:
            slots[_MAX] = latency
        if expirations > 1:
            slots[_MISSED] += expirations - 1
        if busy_ns > self._period_ns:
            slots[_EXCEEDED] += 1
        if latency_ns > self._late_ns:
            slots[_LATE] += 1

    def histogram(self) -> NDArray[np.int64]:
        """Wake-ups per microsecond of latency."""
        return np.array(self._slots[:BINS], dtype=np.int64)

    def summary(self) -> CycleSummary:
        """The figures so far."""
        slots = [int(slot) for slot in self._slots[BINS:SLOTS]]
        cycles, missed, exceeded, late, total, lowest, highest, busy = slots
        histogram = self.histogram()
        rank = np.cumsum(histogram)
        p50, p99, p999 = (int(np.searchsorted(rank, share * rank[-1])) for share in (0.5, 0.99, 0.999))
        elapsed = max((cycles + missed) * self._period_ns, 1)
        return CycleSummary(
            period_us=self._period_ns / 1000,
            cycles=cycles,
            min_us=lowest if cycles else 0,
            mean_us=total / max(cycles, 1),
            p50_us=p50,
            p99_us=p99,
            p999_us=p999,
            max_us=highest,
            late=late,
            missed=missed,
            exceeded=exceeded,
            overflow=int(histogram[-1]),
            busy=busy / elapsed,
        )
