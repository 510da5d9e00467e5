"""An error that wanders slowly is told from one that changes with the motion."""

from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.report import wander
from acqd.discrepancy.report.wander import slow_part, wandering

STEP_S = 0.04


def noise(random, size_W=1.0):
    return [random.normal(0, size_W, 1000) for _ in range(6)]


def walk(random):
    return [np.cumsum(random.normal(0, 0.3, 1000)) + random.normal(0, 4.0) for _ in range(6)]


def closed(errors, reference_errors, monkeypatch):
    monkeypatch.setattr(wander, "errors_of", lambda model, segments: segments)
    subject = SimpleNamespace(data=SimpleNamespace(step_s=STEP_S), model=None, reference=reference_errors)
    return SimpleNamespace(subject=subject, errors_before=errors)


def test_the_slow_part_of_a_walk_is_large_and_that_of_noise_and_of_motion_small():
    random = np.random.default_rng(1)
    motion = [10.0 * np.sin(2 * np.pi * 0.4 * STEP_S * np.arange(1000)) for _ in range(6)]
    assert slow_part(walk(random), STEP_S)[1] > 0.8
    assert slow_part(noise(random), STEP_S)[1] < 0.02
    assert slow_part(motion, STEP_S)[1] < 0.02
    assert slow_part([np.ones(20)], STEP_S) == (0.0, 0.0)


def test_a_constant_is_no_wander():
    assert slow_part([np.full(1000, 7.0)] * 3, STEP_S)[0] == pytest.approx(0.0)


def test_the_advice_comes_where_the_error_wanders_more_than_that_of_the_reference(monkeypatch):
    random = np.random.default_rng(2)
    assert "wanders slowly" in wandering(closed(walk(random), noise(random), monkeypatch))
    assert wandering(closed(noise(random), noise(random), monkeypatch)) == ""
    assert wandering(closed(walk(random), walk(random), monkeypatch)) == ""  # as always with this robot
