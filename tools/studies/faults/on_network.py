"""Faults of the network between a service and the broker."""

from __future__ import annotations

import random

from tools.studies.faults.bed import Bed
from tools.studies.faults.fault import Fault, pause


def cut(side: str, mode: str, also_reset: bool) -> Fault:
    """The proxy passes nothing for some seconds."""

    def fault(bed: Bed, chance: random.Random) -> None:
        proxy = bed.proxies[side]
        proxy.mode = mode  # type: ignore[assignment]
        if also_reset:
            proxy.reset()
        pause(chance, 0.2, 5.0)
        proxy.mode = "pass"

    return fault


def reset(side: str) -> Fault:
    """Connections are reset, several times."""

    def fault(bed: Bed, chance: random.Random) -> None:
        for _ in range(chance.randint(1, 5)):
            bed.proxies[side].reset()
            pause(chance, 0.0, 0.4)

    return fault


def latency(side: str) -> Fault:
    """Packets take 50 to 500 ms each way."""

    def fault(bed: Bed, chance: random.Random) -> None:
        bed.proxies[side].latency_s = chance.uniform(0.05, 0.5)
        pause(chance, 1.0, 4.0)
        bed.proxies[side].latency_s = 0.0

    return fault
