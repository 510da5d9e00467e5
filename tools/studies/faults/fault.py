"""What a fault is."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import ExitStack

from tools.studies.faults.bed import Bed
from tools.studies.faults.process import Process

Begin = Callable[[Bed, ExitStack], None]
"""Begins a fault; what the stack calls at its end takes the fault away."""
Fault = Callable[[Bed, random.Random], None]
"""Disturbs the bed and returns when the disturbance is over: from then on the chain has to recover by itself."""
Pick = Callable[[Bed], Process | None]
"""One of the processes; None where the bed does not have it."""
RESTART_S = (0.2, 1.0)
"""systemd's RestartSec, shortened."""


def pause(chance: random.Random, shortest_s: float, longest_s: float) -> None:
    """Let a random time pass."""
    time.sleep(chance.uniform(shortest_s, longest_s))


def lasting(*begins: Begin) -> Fault:
    """One of these for some seconds."""

    def fault(bed: Bed, chance: random.Random) -> None:
        with ExitStack() as stack:
            chance.choice(begins)(bed, stack)
            pause(chance, 1.0, 5.0)

    return fault
