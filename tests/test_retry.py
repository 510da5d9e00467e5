"""Pauses between attempts, and silence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.retry import Backoff, Heartbeat, RetryPolicy


def tries(policy, until_ns, step_ns=10_000_000):
    backoff = Backoff(policy)
    return [now for now in range(0, until_ns, step_ns) if backoff.due(now)]


def test_the_pauses_grow_and_stay_bounded():
    policy = RetryPolicy(first_s=0.5, longest_s=8.0, jitter=0.25)
    pauses = np.diff(tries(policy, 200_000_000_000)) * 1e-9
    assert pauses[0] <= 0.51 and pauses.max() <= 8.01 and pauses[6:].min() >= 5.99


def test_a_connection_that_works_shortens_the_pause_again():
    backoff = Backoff(RetryPolicy(first_s=1.0, longest_s=64.0, jitter=0.0, stable_s=5.0))
    assert [backoff.pause_s() for _ in range(4)] == [1.0, 2.0, 4.0, 8.0]
    backoff.ended(lasted_s=4.9)
    assert backoff.pause_s() == 16.0  # it flaps
    backoff.ended(lasted_s=5.0)
    assert backoff.pause_s() == 1.0
    assert backoff.due(0)
    backoff.reset()
    assert backoff.due(1)


@given(st.floats(0.01, 5), st.floats(5, 100), st.floats(0, 1), st.integers(1, 50))
def test_no_pause_is_longer_than_the_longest(first_s, longest_s, jitter, count):
    backoff = Backoff(RetryPolicy(first_s, longest_s, jitter))
    pauses = [backoff.pause_s() for _ in range(count)]
    assert all(0 <= pause <= longest_s for pause in pauses) and pauses[0] <= first_s


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.mark.parametrize("advances", [True, False])
def test_silence_is_standing_still_for_the_limit(advances):
    clock = Clock()
    heartbeat, alive = Heartbeat(2.0, look_s=0.25, clock=clock), []
    for look in range(12):
        clock.now += 0.25
        alive.append(heartbeat.check(look if advances else 7))
    assert all(alive) if advances else alive == [True] * 8 + [False] * 4


def test_a_pause_of_the_observer_is_no_silence_of_the_observed():
    clock = Clock()
    heartbeat = Heartbeat(2.0, look_s=0.25, clock=clock)
    heartbeat.check(1)
    clock.now += 3600
    assert heartbeat.check(1)
    clock.now += 0.25
    assert heartbeat.check(2) and heartbeat.silent_s == 0
