"""Healthy or not, and why: one sentence per problem."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from acqd.daemon.health.snapshot import Cycles, Delivery, Link, Snapshot, SourceLink

SPOOL_ALERT = 0.9
"""Share of the spool's limit from which on its filling is a problem."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What follows from a snapshot."""

    alive: bool
    """/healthz: the process does its work; if not, a restart may help."""
    problems: list[str]
    """/readyz: what keeps rows from arriving; none: ready."""
    notes: list[str]
    """What somebody should know although rows arrive."""

    @property
    def ready(self) -> bool:
        """Alive and without problems."""
        return self.alive and not self.problems


def verdict(snapshot: Snapshot) -> Verdict:
    """Judge a snapshot; of several sources, every sentence names the one that is meant."""
    problems, notes = [] if snapshot.alive else _dead(snapshot), []
    for of, link, cycles in _sources(snapshot):
        problems += _away(f"source{of}", link)
        notes += [f"source{of}: {link.trouble}"] if link.connected and link.trouble else []
        notes += [f"MAIN_FAST{of} was relaunched {_times(cycles.restarts)}"] if cycles and cycles.restarts else []
    again = [box for box in snapshot.boxes if box.restarts]
    notes += [f"source of {box.name} was started again {_times(box.restarts)} after failures" for box in again]
    problems += _away("broker", snapshot.broker) + _away("database", snapshot.database)
    if snapshot.delivery is not None:
        problems += _delivery_problems(snapshot.delivery)
        if snapshot.delivery.dropped:
            notes.append(f"{snapshot.delivery.dropped} messages were dropped since the start")
    if snapshot.synchronised is False:
        notes.append("the clock is not synchronised: rows are flagged; enable chrony or systemd-timesyncd")
    if snapshot.quarantined:
        notes.append(f"{snapshot.quarantined} messages are in quarantine")
    return Verdict(snapshot.alive, problems, notes)


def _away(name: str, link: Link | None) -> list[str]:
    if link is None or link.connected:
        return []
    return [f"{name} away" + (f": {link.trouble}" if link.trouble else "")]


def _sources(snapshot: Snapshot) -> Iterator[tuple[str, SourceLink, Cycles | None]]:
    """Name (empty where there is one source only), connection and cycles of every source."""
    for box in snapshot.boxes:
        yield f" of {box.name}", box.source, box.cycles
    if not snapshot.boxes:
        yield "", snapshot.source or SourceLink(True), snapshot.cycles


def _dead(snapshot: Snapshot) -> list[str]:
    if snapshot.service == "sink":
        return ["the sink hangs: its loop has not turned for minutes"]
    dead = [_silence(f" of {box.name}", box.last_row_age_s) for box in snapshot.boxes if not box.alive]
    return dead or [_silence("", snapshot.last_row_age_s)]


def _silence(of: str, age_s: float | None) -> str:
    return f"no rows{of} since the start" if age_s is None else f"no rows{of} for {age_s:.0f} s"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _delivery_problems(delivery: Delivery) -> list[str]:
    problems = []
    size, limit = delivery.spool_bytes, delivery.spool_limit_bytes
    if size is not None and limit and size > SPOOL_ALERT * limit:
        problems.append(f"spool {100 * size / limit:.0f} % full; rows will be dropped")
    if delivery.disk_trouble:
        problems.append(f"spool: {delivery.disk_trouble}")
    return problems
