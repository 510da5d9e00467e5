"""The periodic timer."""

from __future__ import annotations

import time

from acqd.plc.timer import PeriodicTimer


def test_timer_counts_every_period():
    timer = PeriodicTimer(1_000_000)
    made = timer.due_ns
    total = sum(timer.wait() for _ in range(50))
    assert total >= 50 and timer.due_ns == made + total * 1_000_000
    assert time.monotonic_ns() >= timer.due_ns
    timer.close()
