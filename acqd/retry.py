"""When to try again what has failed, and when to call silent what should have moved: one policy for every connection.

Sources, broker, database and MAIN_FAST use the same back-off. It does no waiting, so it serves cyclic tasks with a
virtual clock (`due`), threads and coroutines (`pause_s`) alike. Jitter keeps the clients of one server from coming back
together (Brooker, "Exponential Backoff And Jitter", 2015).
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RetryPolicy:
    """Pauses between attempts."""

    first_s: float = 0.2
    """Pause after the first failure [s]."""
    longest_s: float = 1.0
    """The pause doubles up to this [s]."""
    jitter: float = 0.25
    """A pause is shorter than nominal by up to this share."""
    stable_s: float = 5.0
    """What ends sooner than this after its start [s] counts as another failure."""


LOCAL_NETWORK = RetryPolicy()
"""For everything within the plant: a server that is back is used within a second."""
SHARED_LINE = RetryPolicy(first_s=1.0, longest_s=30.0)
"""For one of several devices on a line: each attempt costs the other devices the time-out of an answer."""


class Backoff:
    """Exponential back-off with jitter for one connection."""

    def __init__(self, policy: RetryPolicy = LOCAL_NETWORK) -> None:
        self._policy = policy
        self._nominal_s = policy.first_s
        self.next_ns = 0
        """When the next attempt is due, on the clock that `due` is asked with [ns]."""

    def pause_s(self) -> float:
        """The pause before the next attempt [s]; the one after it is longer."""
        pause = self._nominal_s * random.uniform(1 - self._policy.jitter, 1.0)
        self._nominal_s = min(2 * self._nominal_s, self._policy.longest_s)
        return pause

    def due(self, now_ns: int) -> bool:
        """Whether it is time for the next attempt; an answer of yes starts the pause that follows a failure."""
        if now_ns < self.next_ns:
            return False
        self.next_ns = now_ns + round(self.pause_s() * 1e9)
        return True

    def reset(self) -> None:
        """The connection works."""
        self._nominal_s, self.next_ns = self._policy.first_s, 0

    def ended(self, lasted_s: float) -> None:
        """The connection has ended after `lasted_s`: only a stable one shortens the next pause."""
        if lasted_s >= self._policy.stable_s:
            self.reset()


class Heartbeat:
    """Tells whether something that should advance has stood still for too long.

    Time counts only as far as it is looked at: when the observer itself was stopped (a suspended machine, a frozen
    control group), its pause is no silence of the observed.
    """

    def __init__(self, limit_s: float, look_s: float = 0.25, clock: Callable[[], float] = time.monotonic) -> None:
        """Silent after `limit_s`, when `check` is called about every `look_s`."""
        self._limit_s, self._longest_s, self._clock = limit_s, 2 * look_s, clock
        self._mark: object = None
        self._looked = clock()
        self.silent_s = 0.0
        """Observed time since the last advance [s]."""

    def check(self, mark: object) -> bool:
        """Whether all is well; `mark` is anything that differs from call to call while the observed advances."""
        now = self._clock()
        step, self._looked = now - self._looked, now
        if mark != self._mark:
            self._mark, self.silent_s = mark, 0.0
        else:
            self.silent_s += min(step, self._longest_s)
        return self.silent_s < self._limit_s
