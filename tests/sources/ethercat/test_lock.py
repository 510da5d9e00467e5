"""The phase lock."""

from __future__ import annotations

from acqd.sources.ethercat.lock import PhaseLock


def test_the_phase_lock_settles_at_its_target_although_the_clocks_differ_by_100_ppm():
    lock, period = PhaseLock(1_000_000), 1_000_000
    wake, phases = 123_456.0, []
    for _ in range(4_000):
        wake += period * (1 + 100e-6) + lock.correction_ns(round(wake), 0)
        phases.append(wake % period)
    assert all(abs(phase - 500_000) < 2_000 for phase in phases[-500:])
