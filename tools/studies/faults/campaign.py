"""One bed, many faults: seeded, timed, reconciled."""

from __future__ import annotations

import random
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.studies.faults.bed import Bed, Kind
from tools.studies.faults.faults import ALL, FAKED_CLOCK_ONLY, POSTGRES_ONLY
from tools.studies.faults.reconcile import Reconciled, missing, reconcile

_RECOVERY_S = 30.0
"""Longest time to wait for a new row in the database after a fault."""
_DRAIN_S = 60.0
"""Longest time to wait for the backlog at the end."""


@dataclass(frozen=True, slots=True)
class Hit:
    """One fault."""

    fault: str
    lasted_s: float
    recovery_s: float | None
    """From the end of the fault until a row made after it is stored; None: not within 30 s."""


@dataclass(slots=True)
class Outcome:
    """One bed."""

    bed: str
    seed: int
    hits: list[Hit] = field(default_factory=list)
    seconds: float = 0.0
    died: dict[str, int] = field(default_factory=dict)
    """Processes that ended by themselves."""
    rows: Reconciled | None = None

    @property
    def recoveries(self) -> list[float]:
        """Recovery times [s] of the faults that were recovered from."""
        return [hit.recovery_s for hit in self.hits if hit.recovery_s is not None]

    def figures(self) -> dict[str, Any]:
        """The line of the table."""
        times, rows = self.recoveries, self.rows
        assert rows is not None
        kills = sum(hit.fault in ("daemon killed", "all killed") for hit in self.hits)
        return {
            "bed": self.bed, "faults": len(self.hits), "seconds": round(self.seconds), "made": rows.made,
            "stored": rows.stored, "lost": rows.lost, "daemon kills": kills, "duplicated": rows.duplicated,
            "wrong": rows.wrong, "unflagged": rows.unflagged, "backwards": rows.backwards,
            "energy back": rows.energy_back, "not recovered": len(self.hits) - len(times),
            "mean recovery s": round(sum(times) / len(times), 2) if times else None,
            "worst recovery s": round(max(times), 2) if times else None, "died": sum(self.died.values()),
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Plan:
    """What is done to each bed."""

    seed: int
    faults: int
    only: frozenset[str] = frozenset()
    """Empty: all."""
    clock: bool = False
    """Also set the daemon's clock."""

    def names(self, kind: Kind, chance: random.Random) -> list[str]:
        """The faults of a bed, each kind equally often."""
        impossible = set() if kind.database == "postgres" else set(POSTGRES_ONLY)
        impossible |= set() if self.clock else FAKED_CLOCK_ONLY
        names = [name for name in ALL if name not in impossible and (not self.only or name in self.only)]
        plan: list[str] = []
        while names and len(plan) < self.faults:
            plan += chance.sample(names, len(names))
        return plan[: self.faults]


def run(kind: Kind, folder: Path, plan: Plan, tick: Callable[[str], None]) -> Outcome:
    """Carry the plan out on one bed; `tick` hears of every fault."""
    chance, outcome, begun = random.Random(f"{plan.seed} {kind}"), Outcome(str(kind), plan.seed), time.monotonic()
    bed = Bed(kind, folder, plan.clock)
    try:
        bed.start()
        bed.tape.touch()
        recovered(bed)
        for name in plan.names(kind, chance):
            outcome.hits.append(_hit(bed, name, chance))
            tick(name)
            bed.revive()
            time.sleep(chance.uniform(0.3, 1.5))
        settle(bed)
        services = {"daemon": bed.daemon, "sink": bed.sink, "broker": bed.broker}
        outcome.died = {name: process.deaths for name, process in services.items() if process.deaths}
        outcome.rows = reconcile(bed.tape, bed.engine)
    finally:
        bed.stop()
    outcome.seconds = time.monotonic() - begun
    return outcome


def _hit(bed: Bed, name: str, chance: random.Random) -> Hit:
    begun = time.monotonic()
    ALL[name](bed, chance)
    return Hit(name, round(time.monotonic() - begun, 3), recovered(bed))


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
    """The daemon stops; what it made has time to arrive."""
    time.sleep(1.0)
    bed.daemon.stop()
    deadline = time.monotonic() + _DRAIN_S
    quiet_since, before = time.monotonic(), -1
    while time.monotonic() < deadline:
        left = missing(bed.tape, bed.engine)
        if left != before:
            quiet_since, before = time.monotonic(), left
        # With a spool, rows are still in it: a daemon has to run to deliver them.
        if not left or time.monotonic() - quiet_since > 10.0:
            return
        time.sleep(0.5)


def forget(folder: Path) -> None:
    """Remove the folder of a bed."""
    shutil.rmtree(folder, ignore_errors=True)
