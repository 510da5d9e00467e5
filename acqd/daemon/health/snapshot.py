"""What a service knows about itself at one moment: the source of /status, /metrics and the verdict."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from acqd.plc.distribution import Distribution


@dataclass(frozen=True, slots=True)
class Link:
    """A connection that is made again when it is lost."""

    connected: bool
    reconnects: int = 0
    """Times it was made again since the start."""
    trouble: str = ""
    """Why it is down, or what is wrong with it; one line."""
    certificate_trouble: str = field(default="", kw_only=True)
    """That the certificate of the other side ends soon, else empty."""


@dataclass(frozen=True, slots=True)
class SourceLink(Link):
    """The connection to the device."""

    lost: int = 0
    """Samples lost since the start."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """Rows on their way to the database, in messages and bytes since the start; None: this daemon has no such thing."""

    delivered: int = 0
    """Acknowledged by the broker."""
    dropped: int = 0
    """Given up because the spool (or queue) was full or its disk was damaged."""
    waiting: int = 0
    """Not delivered yet."""
    resent: int | None = None
    """Published again because no receipt came in time."""
    receipts_outstanding: int | None = None
    """Published and not yet known to be stored."""
    spool_bytes: int | None = None
    spool_limit_bytes: int | None = None
    spool_age_s: float | None = None
    """Age of the oldest row that waits [s]."""
    disk_trouble: str = ""
    """Why the disk takes no rows."""
    reading_trouble: str = ""
    """Why rows that wait cannot be read back."""
    left_behind: str = ""
    """Which rows wait in the spool of another name, or in files that are not the spool's."""
    deleted: int = 0
    """How often somebody has deleted files of the spool while the daemon ran."""
    gone_back: int = 0
    """Times that receipts have shown the database of a sink in an earlier state."""
    registers_back: str = ""
    """Which register began below what an earlier run has published."""
    cuts: int = 0
    """Devices whose last run has ended with the computer's power."""
    cuts_unconfirmed: int = 0
    """Those of them whose W may have gone back, because no sink has said which rows it has."""
    receipt_lag_s: float = 0.0
    """How long the oldest row under way has waited for its receipt while a sink is online [s]."""
    unreceipted_s: float = 0.0
    """How long no receipt has come while a sink is online [s]."""
    alone_s: float = 0.0
    """How long no sink is known although the broker is there [s]."""
    rights_trouble: str = ""
    """Which rows the broker acknowledges and does not take."""
    clock_trouble: str = ""
    """How this computer's clock differs from that of the sinks."""
    old_after_s: float | None = None
    """Age from which on rows that wait are a problem [s]."""


@dataclass(frozen=True, slots=True)
class Archive:
    """Samples that are kept ([archive])."""

    folder: str
    bytes: int = 0
    limit_bytes: int = 0
    files: int = 0
    seconds: float = 0.0
    """Of samples of the device that has most."""
    lost: int = 0
    """Samples (of all channels) since the start that the archive could not take."""
    deleted: int = 0
    """Segments since the start that made room."""
    trouble: str = ""
    """Why samples are not kept at present, else empty."""


@dataclass(frozen=True, slots=True)
class Cycles:
    """MAIN_FAST."""

    cycles: int = 0
    late: int = 0
    missed: int = 0
    exceeded: int = 0
    restarts: int = 0
    """Times MAIN_FAST was launched again."""
    latency: Distribution | None = None
    """How late MAIN_FAST woke."""
    slow: Distribution | None = None
    """How long MAIN_SLOW took per wake-up."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows metered since the start."""

    made: int = 0
    flagged: int = 0
    """Those with a flag that says something about their values (`acqd.daemon.tally`)."""
    flags: dict[str, int] = field(default_factory=dict)
    """Windows by flag."""

    def __add__(self, other: Windows) -> Windows:
        """Windows of both."""
        names = {**self.flags, **other.flags}
        flags = {name: self.flags.get(name, 0) + other.flags.get(name, 0) for name in names}
        return Windows(self.made + other.made, self.flagged + other.flagged, flags)


@dataclass(frozen=True, slots=True)
class BoxHealth:
    """One source of a daemon. Counts go on when the source is made again."""

    name: str
    """Devices of its rows."""
    devices: tuple[str, ...]
    kind: str
    """Of the source."""
    source: SourceLink
    alive: bool = True
    """Whether its rows advance, or it is known to be away."""
    ended: bool = False
    """Whether the source has come to its end, as recordings do."""
    restarts: int = 0
    """Times the source was made again after a failure."""
    boot: str = ""
    last_row_age_s: float | None = None
    windows: Windows = Windows()
    cycles: Cycles | None = None
    synchronised: bool | None = None
    register_trouble: str = ""
    """Why its energy register is not written to the disk, else empty."""


@dataclass(frozen=True, slots=True)
class FeedHealth:
    """What makes the rows of a daemon."""

    boot: str
    source: SourceLink
    last_row_age_s: float | None
    cycles: Cycles | None = None
    synchronised: bool | None = None
    windows: Windows = Windows()
    boxes: tuple[BoxHealth, ...] = ()
    """Of a daemon with several sources: each of them."""
    register_trouble: str = ""
    """Why energy registers are not written to the disk, else empty."""


@dataclass(frozen=True, slots=True)
class Acknowledged:
    """What a person has seen: counts up to these are no problem any more, but a note."""

    dropped: int = 0
    quarantined: int = 0
    recalls: int = 0
    deleted: int = 0
    cuts: int = 0


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One service."""

    service: Literal["daemon", "sink"]
    name: str
    """Device of the daemon, client_id of the sink."""
    version: str
    uptime_s: float
    alive: bool
    """Whether the service does its work, or waits for something that is known to be away."""
    rows: int = 0
    """Rows made by the daemon, or stored by the sink."""
    last_row_age_s: float | None = None
    """Seconds since the last of them; None before the first."""
    boot: str | None = None
    quarantined: int | None = None
    """Messages that are no new rows."""
    impossible: int = 0
    """Of these, rows whose time cannot be true."""
    lag_s: float = 0.0
    """How long the newest batch has waited for its commit [s]."""
    clock_trouble: str = ""
    """What is wrong with this computer's clock."""
    boots_trouble: str = ""
    """Which devices have two daemons."""
    certificate_trouble: str = ""
    """Which certificate ends soon."""
    register_trouble: str = ""
    """Why energy registers are not written to the disk."""
    refused_trouble: str = ""
    """Whose rows a changed table refuses, and why."""
    upkeep_trouble: str = ""
    """Why roll-ups and retention do not run."""
    disk_days: float | None = None
    """Days until the disk of the database is full, at the present rate; None: unknown."""
    recalls: int = 0
    """Times the database was found in an earlier state."""
    source: SourceLink | None = None
    broker: Link | None = None
    database: Link | None = None
    delivery: Delivery | None = None
    archive: Archive | None = None
    cycles: Cycles | None = None
    synchronised: bool | None = None
    """Whether the clock is disciplined; None: nobody can tell."""
    windows: Windows | None = None
    acknowledged: Acknowledged = Acknowledged()
    boxes: tuple[BoxHealth, ...] = ()
    """Of a daemon with several sources: each of them."""
