"""Statistics of the cycles."""

from __future__ import annotations

import numpy as np

from acqd.plc.stats import SLOTS, CycleStats


def test_cycle_statistics_count_like_cyclictest():
    stats = CycleStats(np.zeros(SLOTS, dtype=np.int64), 1_000_000)
    stats.clear()
    for latency in range(1, 1_001):
        stats.record(latency * 1_000, 1, 30_000)
    stats.record(5_000_000, 4, 1_200_000)
    summary = stats.summary()
    assert (summary.cycles, summary.min_us, summary.max_us) == (1_001, 1, 5_000)
    assert (summary.missed, summary.exceeded, summary.overflow) == (3, 1, 1)
    assert summary.p50_us == 501 and summary.p99_us == 991 and summary.late == 501
