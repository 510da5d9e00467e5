"""What the daemon knows about the delivery of its rows, for the status topic and for metrics."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.telemetry.certificates import Validity


@dataclass(frozen=True, slots=True)
class TelemetryCounters:
    """Counts since the start of the daemon, and the present state of the spool."""

    rows: int
    """Rows made."""
    delivered: int
    """Messages that the broker has acknowledged."""
    dropped: int
    """Rows that the full spool dropped, or that damage to the disk destroyed."""
    resent: int
    """Rows for which no receipt came in time."""
    waiting: int
    """Rows that are not delivered, rows of earlier starts included."""
    receipts_outstanding: int
    """Rows that were published and have no receipt yet."""
    spool_bytes: int
    spool_limit_bytes: int
    spool_age_s: float
    """Age of the oldest row that waits, to the length of a segment [s]."""
    damaged_bytes: int
    """Bytes of the spool that were torn or unreadable at the start."""
    disk_trouble: str
    """Why the disk takes no rows, else empty."""
    reading_trouble: str
    """Why rows that wait cannot be read back, else empty."""
    left_behind: str
    """Which rows wait in the spool of another name, or in files that are not the spool's, else empty."""
    deleted: int
    """How often somebody has deleted files of the spool while the daemon ran."""
    registers_back: str
    """Which register began below what an earlier run has published, else empty."""
    cuts: int
    """Devices whose last run has ended with the computer's power."""
    cuts_unconfirmed: int
    """Those of them for which no sink has said which rows it has: W may have gone back."""
    receipt_lag_s: float
    """How long the oldest row under way has waited for its receipt while a sink is online [s]."""
    unreceipted_s: float
    """How long no receipt has come while a sink is online [s]."""
    alone_s: float
    """How long no sink is known although the broker is there [s]."""
    connected: bool
    broker_trouble: str
    """Why connections end again and again, else empty."""
    certificate: Validity | None
    """When the broker's certificate is valid; None without TLS."""
    rights_trouble: str
    """Which rows the broker acknowledges and does not take, else empty."""
    clock_trouble: str
    """How this computer's clock differs from that of the sinks, else empty."""
    reconnects: int
    gone_back: int
    """Times that receipts have shown the database of a sink in an earlier state."""
    sink_seen: bool
    """Whether a sink has announced itself or sent a receipt."""
