"""Healthy or not, and why: one sentence per problem."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from acqd.daemon.health.snapshot import Acknowledged, Cycles, Delivery, Link, Snapshot, SourceLink

SPOOL_ALERT = 0.9
"""Share of the spool's limit from which on its filling is a problem."""
UNRECEIPTED_S = 10.0
"""A receipt comes within a second; a sink that is online and silent for longer does not get the rows."""
LAG_S = 2.0
"""Rows are stored within half a second of their message."""
ALONE_S = 30.0
"""A sink that is started again is back sooner."""
DISK_DAYS = 14.0
"""Time to buy a disk."""


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
    seen = snapshot.acknowledged
    problems, notes = [] if snapshot.alive else _dead(snapshot), []
    for of, link, cycles in _sources(snapshot):
        problems += _away(f"source{of}", link)
        notes += [f"source{of}: {link.trouble}"] if link.connected and link.trouble else []
        notes += [f"MAIN_FAST{of} was relaunched {_times(cycles.restarts)}"] if cycles and cycles.restarts else []
    again = [box for box in snapshot.boxes if box.restarts]
    notes += [f"source of {box.name} was started again {_times(box.restarts)} after failures" for box in again]
    if snapshot.broker is not None and snapshot.broker.trouble and snapshot.broker.connected:
        problems.append(f"name taken: {snapshot.broker.trouble}")
    problems += _away("broker", snapshot.broker) + _away("database", snapshot.database)
    if snapshot.delivery is not None:
        problems += _delivery_problems(snapshot.delivery)
        dropped = f"{_of(snapshot.delivery.dropped, 'message was', 'messages were')} dropped since the start"
        _counted(snapshot.delivery.dropped, seen.dropped, dropped, problems, notes)
        _lost_at_once(snapshot.delivery, seen, problems, notes)
    problems += [f"energy register: {snapshot.register_trouble}"] if snapshot.register_trouble else []
    if snapshot.archive is not None:
        problems += [f"archive: {snapshot.archive.trouble}; rows go on"] if snapshot.archive.trouble else []
        notes += [f"archive: {snapshot.archive.lost} samples were not kept"] if snapshot.archive.lost else []
    if snapshot.synchronised is False:
        notes.append("the clock is not synchronised: rows are flagged; enable chrony or systemd-timesyncd")
    problems += _sink_problems(snapshot)
    shown = snapshot.broker.certificate_trouble if snapshot.broker is not None else ""
    problems += [text for text in (snapshot.certificate_trouble, shown) if text]
    late = f", {snapshot.impossible} of them rows whose time cannot be true: is a device's clock wrong?"
    waiting = _of(snapshot.quarantined or 0, "message is", "messages are")
    waiting += f" in quarantine{late if snapshot.impossible else ''}"
    _counted(snapshot.quarantined or 0, seen.quarantined, waiting, problems, notes)
    recalls = f"{_of(snapshot.recalls, 'time', 'times')} the database was found in an earlier state"
    _counted(snapshot.recalls, seen.recalls, recalls, problems, notes)
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


def _of(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}"


def _counted(count: int, seen: int, said: str, problems: list[str], notes: list[str]) -> None:
    """A problem until a person has acknowledged it (`acqd status --acknowledge`), a note from then on."""
    if count:
        (problems if count > seen else notes).append(said)


def _lost_at_once(delivery: Delivery, seen: Acknowledged, problems: list[str], notes: list[str]) -> None:
    """Power cuts, deleted files, databases that were put back: over at once, so until a person has seen them."""
    deleted = (
        f"{_of(delivery.deleted, 'time', 'times')} somebody deleted or changed files of the spool: "
        "what could be was written again, and older rows may be missing"
    )
    _counted(delivery.deleted, seen.deleted, deleted, problems, notes)
    back = (
        f"{_of(delivery.gone_back, 'time', 'times')} the database of a sink was found in an earlier state: "
        "the rows that are kept were sent again, and older rows may be missing there"
    )
    _counted(delivery.gone_back, seen.recalls, back, problems, notes)
    unconfirmed = (
        f"{_of(delivery.cuts_unconfirmed, 'power cut or restored backup', 'power cuts or restored backups')} "
        "before this start, and no sink has said which rows it has: W may be up to a second behind"
    )
    _counted(delivery.cuts_unconfirmed, seen.cuts, unconfirmed, problems, notes)
    if delivery.alone_s > ALONE_S and delivery.waiting:
        notes.append(
            f"no sink is known, and {delivery.waiting} rows wait: does one run, and may this daemon read its status?"
        )
    if delivery.registers_back:
        notes.append(delivery.registers_back)
    if delivery.cuts > delivery.cuts_unconfirmed:
        notes.append("the computer lost its power before this start: its last second may be missing, W goes on")


def _sink_problems(snapshot: Snapshot) -> list[str]:
    problems = [text for text in (snapshot.clock_trouble, snapshot.refused_trouble, snapshot.upkeep_trouble) if text]
    if snapshot.boots_trouble:
        problems.append(f"name taken: {snapshot.boots_trouble}")
    if snapshot.lag_s > LAG_S:
        problems.append(f"database slow: rows wait {snapshot.lag_s:.1f} s for their commit")
    if snapshot.disk_days is not None and snapshot.disk_days < DISK_DAYS:
        problems.append(f"disk of the database full in {snapshot.disk_days:.1f} days at this rate")
    return problems


def _delivery_problems(delivery: Delivery) -> list[str]:
    problems = []
    size, limit = delivery.spool_bytes, delivery.spool_limit_bytes
    if size is not None and limit and size > SPOOL_ALERT * limit:
        problems.append(f"spool {100 * size / limit:.0f} % full; rows will be dropped")
    if delivery.disk_trouble:
        problems.append(f"spool: {delivery.disk_trouble}")
    if delivery.reading_trouble:
        problems.append(f"spool: {delivery.reading_trouble}")
    if delivery.left_behind:
        problems.append(f"spool: {delivery.left_behind}")
    if delivery.clock_trouble:
        problems.append(delivery.clock_trouble)
    if delivery.rights_trouble:
        problems.append(f"rows refused: {delivery.rights_trouble}")
    elif delivery.unreceipted_s > UNRECEIPTED_S:
        problems.append(
            f"no receipt for {delivery.unreceipted_s:.0f} s although a sink is online: is its database away, or "
            "does the broker refuse the rows?"
        )
    elif delivery.receipt_lag_s > LAG_S:
        problems.append(
            f"receipts late: rows wait {delivery.receipt_lag_s:.1f} s for theirs; sink, database or broker is slow"
        )
    if delivery.old_after_s and delivery.spool_age_s and delivery.spool_age_s > delivery.old_after_s:
        problems.append(f"spool: rows have waited for {delivery.spool_age_s / 86_400:.1f} days")
    return problems
