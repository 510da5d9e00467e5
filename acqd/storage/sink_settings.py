"""Settings of the sink, and what it counts."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.storage.allowance import MALFORMED_BYTES_PER_DAY
from acqd.telemetry.certificates import Validity


@dataclass(frozen=True, slots=True)
class SinkSettings:
    """How the sink batches and shares."""

    client_id: str = "acqd-sink"
    group: str = ""
    """Shared-subscription group: its sinks share the rows. Empty: every row comes here."""
    batch: int = 2_000
    """Messages per transaction at most; the broker may have four times as many under way to us."""
    interval: float = 0.25
    """Longest time [s] a row waits for its transaction to begin."""
    malformed_bytes_per_day: float = MALFORMED_BYTES_PER_DAY
    """Malformed messages that are kept in quarantine; more are only counted."""
    mqtt5: bool = True
    """MQTT 5 if the broker can; False: MQTT 3.1.1 from the start."""


@dataclass(slots=True)
class SinkCounters:
    """What the sink has done so far."""

    rows: int = 0
    quarantined: int = 0
    conflicts: int = 0
    """Of the quarantined: rows whose key was stored with other values."""
    impossible: int = 0
    """Of the quarantined: rows whose time cannot be true; `acqd sink quarantine` shows and restores them."""
    batches: int = 0
    reconnects: int = -1
    last_commit: float | None = None
    """Monotonic time of the last commit."""
    broker_trouble: str = ""
    """Why there is no connection to the broker; empty while there is one."""
    certificate: Validity | None = None
    """When the certificate is valid that the broker has shown last; None without TLS."""
    database_trouble: str = ""
    """Why the database takes no rows; empty while it does."""
    database_returns: int = 0
    """Times the database came back."""
    clock_trouble: str = ""
    """What is wrong with this computer's clock; empty while nothing is."""
    boots_trouble: str = ""
    """Which devices have two daemons; empty while none has."""
    refused_trouble: str = ""
    """Whose rows a changed table refuses, and why; empty while it takes all."""
    recalls: int = 0
    """Times the database was found in an earlier state, and the daemons were asked to send again."""
    lag_s: float = 0.0
    """How long the newest committed batch has waited for its commit [s]."""
