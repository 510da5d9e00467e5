"""Steps of the computer's clock."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.plc.clock import STEP_NS, StepDetector


@pytest.mark.parametrize("step_s", [-3600.0, -1.0, 0.5, 86_400.0])
def test_clock_steps_are_seen_and_measured(step_s):
    detector = StepDetector()
    offset, found = 0, None
    for window in range(200):
        now = window * 40_000_000 + 2_000_000 + (window % 7) * 1_000_000
        step = int(step_s * 1e9) if window >= 100 else 0
        found = detector.check(now + step, now - 2_000_000 + offset)
        if found is not None:
            assert window >= 100
            offset += found
    assert abs(offset - step_s * 1e9) < STEP_NS


def test_lateness_is_not_mistaken_for_a_clock_step():
    detector = StepDetector()
    random = np.random.default_rng(0)
    for window in range(5_000):
        late = int(random.exponential(20e6)) + (400_000_000 if window % 50 == 0 else 0)
        assert detector.check(window * 40_000_000 + late, window * 40_000_000) is None
