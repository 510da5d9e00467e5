"""The health of `acqd sink`: endpoints and watchdog around its one thread."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from acqd import __version__
from acqd.daemon.health.section import HealthSection
from acqd.daemon.health.server import HealthServer
from acqd.daemon.health.snapshot import Link, Snapshot
from acqd.daemon.health.watchdog import Watchdog

if TYPE_CHECKING:
    from acqd.storage.sink import Sink

_TURN_S = 120.0  # without a turn of its loop: longer than any lock or statement may take


class SinkHealth:
    """Asked by threads: everything here reads plain attributes and never waits."""

    def __init__(self, section: HealthSection, sink: Sink, name: str) -> None:
        self._sink, self._name = sink, name
        self._begun = self._turned = time.monotonic()
        self._server = HealthServer(section.host, section.sink_port, self.snapshot) if section.sink_port else None
        self._watchdog = Watchdog(self.alive)

    def start(self) -> None:
        """Open the port and feed the watchdog."""
        self._watchdog.start()
        if self._server is not None:
            self._server.start()

    def turned(self) -> None:
        """The sink's loop turns; called by it."""
        self._turned = time.monotonic()

    def alive(self) -> bool:
        """Whether the loop turns: broker and database may be away, and rows may not come."""
        return time.monotonic() - self._turned < _TURN_S

    def snapshot(self) -> Snapshot:
        """The sink now."""
        sink, now = self._sink, time.monotonic()
        counters = sink.counters
        last = counters.last_commit
        trouble = counters.database_trouble
        return Snapshot(
            service="sink",
            name=self._name,
            version=__version__,
            uptime_s=now - self._begun,
            alive=self.alive(),
            rows=counters.rows,
            last_row_age_s=None if last is None else now - last,
            quarantined=counters.quarantined,
            broker=Link(sink.connected, max(counters.reconnects, 0)),
            database=Link(not trouble, counters.database_returns, trouble),
        )

    def stop(self) -> None:
        """Close the port."""
        self._watchdog.stop()
        if self._server is not None:
            self._server.stop()
