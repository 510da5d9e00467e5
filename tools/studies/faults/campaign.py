"""One bed, many faults: seeded, timed, reconciled."""

from __future__ import annotations

import os
import random
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.studies.faults.bed import Bed, Extras, Kind
from tools.studies.faults.faults import ALL, possible
from tools.studies.faults.logs import LOG_DEVICE, LogsDone
from tools.studies.faults.reconcile import Reconciled, missing, reconcile, restore

_RECOVERY_S = 30.0
"""Longest time to wait for a new row in the database after a fault."""
_DRAIN_S = 60.0
"""Longest time to wait for the backlog at the end."""
_LAST_S = 15.0
"""The same for the last rows of a daemon that has stopped."""
_STARTS = 3
"""Attempts to deliver what is left in the spool."""
_UNDER_WAY = 50
"""Rows that are always on their way while the daemon runs: half a second of four channels."""


@dataclass(frozen=True, slots=True)
class Hit:
    """One fault."""

    fault: str
    lasted_s: float
    recovery_s: float | None
    """From the end of the fault until a row made after it is stored; None: not within 30 s."""
    load: float
    """Processes of the computer that ran or were ready to, mean of a minute: others make starts slow."""


@dataclass(slots=True)
class Outcome:
    """One bed."""

    bed: str
    seed: int
    hits: list[Hit] = field(default_factory=list)
    seconds: float = 0.0
    died: dict[str, int] = field(default_factory=dict)
    """Processes that ended by themselves; the database may, when its disk is full."""
    kills: int = 0
    """Of the daemon: by faults, and of one that did not stop in time."""
    rows: Reconciled | None = None
    logs: LogsDone | None = None

    @property
    def recoveries(self) -> list[float]:
        """Recovery times [s] of the faults that were recovered from."""
        return [hit.recovery_s for hit in self.hits if hit.recovery_s is not None]

    @property
    def deaths(self) -> int:
        """Processes of acqd, and brokers, that ended by themselves."""
        return sum(number for name, number in self.died.items() if name != "database")

    def figures(self) -> dict[str, Any]:
        """The line of the table."""
        times, rows = self.recoveries, self.rows
        assert rows is not None
        return {
            "bed": self.bed, "faults": len(self.hits), "seconds": round(self.seconds), "made": rows.made,
            "stored": rows.stored, "lost": rows.lost, "waiting": rows.waiting, "daemon kills": self.kills,
            "cut short": rows.cut_short, "unspooled": rows.unspooled,
            "duplicated": rows.duplicated, "wrong": rows.wrong, "behind forged": rows.contested,
            "unflagged": rows.unflagged, "backwards": rows.backwards, "energy back": rows.energy_back,
            "not recovered": len(self.hits) - len(times),
            "mean recovery s": round(sum(times) / len(times), 2) if times else None,
            "worst recovery s": round(max(times), 2) if times else None, "died": self.deaths,
            "load of the computer": round(sum(hit.load for hit in self.hits) / max(1, len(self.hits)), 1),
            "logs": self.logs and self.logs.arrived, "logs wrong": self.logs and self.logs.wrong,
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Plan:
    """What is done to each bed."""

    seed: int
    faults: int
    only: frozenset[str] = frozenset()
    """Empty: all."""
    extras: Extras = field(default_factory=Extras)

    def names(self, kind: Kind, chance: random.Random) -> list[str]:
        """The faults of a bed, each kind equally often."""
        names = [name for name in possible(kind, self.extras) if not self.only or name in self.only]
        plan: list[str] = []
        while names and len(plan) < self.faults:
            plan += chance.sample(names, len(names))
        return plan[: self.faults]


def run(kind: Kind, folder: Path, plan: Plan, tick: Callable[[str], None]) -> Outcome:
    """Carry the plan out on one bed; `tick` hears of every fault."""
    chance, outcome, begun = random.Random(f"{plan.seed} {kind}"), Outcome(str(kind), plan.seed), time.monotonic()
    bed = Bed(kind, folder, plan.extras)
    try:
        bed.start()
        recovered(bed)
        for name in plan.names(kind, chance):
            outcome.hits.append(_hit(bed, name, chance))
            tick(f"{name}: {outcome.hits[-1].recovery_s} s")
            bed.revive()
            time.sleep(chance.uniform(0.3, 1.5))
        settle(bed)
        outcome.kills = bed.daemon.kills
        outcome.died = {name: process.deaths for name, process in bed.services() if process.deaths}
        outcome.rows = reconcile(bed.tapes, bed.engine, bed.forged, LOG_DEVICE, bed.state_dir)
        outcome.logs = bed.logs.judge(bed.engine) if bed.logs is not None else None
    finally:
        bed.stop()
    outcome.seconds = time.monotonic() - begun
    return outcome


def _hit(bed: Bed, name: str, chance: random.Random) -> Hit:
    begun = time.monotonic()
    if bed.logs is not None:
        bed.logs.arrive(chance)
    ALL[name](bed, chance)
    return Hit(name, round(time.monotonic() - begun, 3), recovered(bed), round(os.getloadavg()[0], 1))


def recovered(bed: Bed) -> float | None:
    """Seconds until a row that is made from now on is stored."""
    over, offset = time.monotonic(), bed.taped()
    while time.monotonic() < over + _RECOVERY_S:
        if bed.arrived(offset):
            return round(time.monotonic() - over, 3)
        bed.revive()
        time.sleep(0.05)
    return None


def settle(bed: Bed) -> None:
    """Backlog and logs have time to arrive; then the daemon stops, and its last rows arrive.

    On a slow computer rows are still in the spool then: a daemon that starts again delivers them.
    """
    for _ in range(_STARTS):
        restore(bed.tapes, bed.engine)
        deadline = time.monotonic() + _DRAIN_S
        _wait_until_stored(bed, _UNDER_WAY, deadline)
        if bed.logs is not None:
            bed.logs.settle(bed.engine, _DRAIN_S)
        bed.daemon.stop()
        restore(bed.tapes, bed.engine)
        deadline = time.monotonic() + _LAST_S
        if not _wait_until_stored(bed, 0, deadline):
            return
        bed.daemon.start()
    bed.daemon.stop()


def forget(folder: Path) -> None:
    """Remove the folder of a bed."""
    shutil.rmtree(folder, ignore_errors=True)


def _wait_until_stored(bed: Bed, most: int, deadline: float) -> int:
    """Wait until at most so many rows are missing, or until the deadline; how many are.

    To count them takes seconds of a computer that is busy, and the proxies are in this process.
    """
    while True:
        begun = time.monotonic()
        left = missing(bed.tapes, bed.engine)
        if left <= most or time.monotonic() > deadline:
            return left
        time.sleep(max(0.5, 4 * (time.monotonic() - begun)))
