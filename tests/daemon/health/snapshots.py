"""Snapshots of services in good and in bad states."""

from __future__ import annotations

from acqd.daemon.health.snapshot import Cycles, Delivery, Link, Snapshot, SourceLink


def daemon(**changes) -> Snapshot:
    """A daemon that works."""
    good = {
        "service": "daemon", "name": "cell1", "version": "1", "uptime_s": 60.0, "alive": True, "rows": 6000,
        "last_row_age_s": 0.03, "boot": "b00t", "source": SourceLink(True, 2, "", 40), "broker": Link(True, 3),
        "delivery": Delivery(5990, 0, 10, 0, 8, 2_000_000, 1_000_000_000, 0.4), "cycles": Cycles(60_000, 5, 2, 1, 0),
        "synchronised": True,
    }  # fmt: skip
    return Snapshot(**good | changes)


def sink(**changes) -> Snapshot:
    """A sink that works."""
    good = {
        "service": "sink", "name": "acqd-sink", "version": "1", "uptime_s": 60.0, "alive": True, "rows": 6000,
        "last_row_age_s": 0.2, "quarantined": 0, "broker": Link(True), "database": Link(True),
    }  # fmt: skip
    return Snapshot(**good | changes)
