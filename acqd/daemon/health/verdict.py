"""Healthy or not, and why: one sentence per problem."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.daemon.health.snapshot import Delivery, Link, Snapshot

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
    """Judge a snapshot."""
    problems = [] if snapshot.alive else [_dead(snapshot)]
    for name in ("source", "broker", "database"):
        link: Link | None = getattr(snapshot, name)
        if link is not None and not link.connected:
            problems.append(f"{name} away" + (f": {link.trouble}" if link.trouble else ""))
    notes = []
    if snapshot.delivery is not None:
        problems += _delivery_problems(snapshot.delivery)
        if snapshot.delivery.dropped:
            notes.append(f"{snapshot.delivery.dropped} messages were dropped since the start")
    if snapshot.source is not None and snapshot.source.connected and snapshot.source.trouble:
        notes.append(f"source: {snapshot.source.trouble}")
    if snapshot.cycles is not None and snapshot.cycles.restarts:
        notes.append(f"MAIN_FAST was relaunched {snapshot.cycles.restarts} times")
    if snapshot.synchronised is False:
        notes.append("the clock is not synchronised: rows are flagged; enable chrony or systemd-timesyncd")
    if snapshot.quarantined:
        notes.append(f"{snapshot.quarantined} messages are in quarantine")
    return Verdict(snapshot.alive, problems, notes)


def _dead(snapshot: Snapshot) -> str:
    if snapshot.service == "sink":
        return "the sink hangs: its loop has not turned for minutes"
    age = snapshot.last_row_age_s
    return "no rows since the start" if age is None else f"no rows for {age:.0f} s"


def _delivery_problems(delivery: Delivery) -> list[str]:
    problems = []
    size, limit = delivery.spool_bytes, delivery.spool_limit_bytes
    if size is not None and limit and size > SPOOL_ALERT * limit:
        problems.append(f"spool {100 * size / limit:.0f} % full; rows will be dropped")
    if delivery.disk_trouble:
        problems.append(f"spool: {delivery.disk_trouble}")
    return problems
