"""The health of `acqd run`: endpoints and watchdog around its feed and its delivery."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from acqd import __version__
from acqd.daemon.feed import Feed
from acqd.daemon.health.section import HealthSection
from acqd.daemon.health.server import HealthServer
from acqd.daemon.health.snapshot import Delivery, Link, Snapshot
from acqd.daemon.health.watchdog import Watchdog

_TURN_S = 5.0  # without a turn of the event loop: it is blocked, and no row gets through it


@dataclass(frozen=True, slots=True)
class Progress:
    """What the service has done so far."""

    rows: int
    delivery: Delivery | None = None
    broker: Link | None = None


class DaemonHealth:
    """Asked by threads: everything here reads plain attributes and never waits."""

    def __init__(self, section: HealthSection, device: str, feed: Feed, progress: Callable[[], Progress]) -> None:
        self._device, self._feed, self._progress = device, feed, progress
        self._begun = self._turned = time.monotonic()
        self._server = HealthServer(section.host, section.port, self.snapshot) if section.port else None
        self._watchdog = Watchdog(self.alive)

    def start(self) -> None:
        """Open the port and feed the watchdog."""
        self._turned = time.monotonic()
        self._watchdog.start()
        if self._server is not None:
            self._server.start()

    def turned(self) -> None:
        """The event loop turns; called by it."""
        self._turned = time.monotonic()

    def alive(self) -> bool:
        """Whether rows advance, or what they need is away and being brought back."""
        return time.monotonic() - self._turned < _TURN_S and self._feed.alive()

    def snapshot(self) -> Snapshot:
        """The daemon now."""
        feed, progress = self._feed.health(), self._progress()
        return Snapshot(
            service="daemon",
            name=self._device,
            version=__version__,
            uptime_s=time.monotonic() - self._begun,
            alive=self.alive(),
            rows=progress.rows,
            last_row_age_s=feed.last_row_age_s,
            boot=feed.boot,
            source=feed.source,
            broker=progress.broker,
            delivery=progress.delivery,
            cycles=feed.cycles,
            synchronised=feed.synchronised,
        )

    def stop(self) -> None:
        """Close the port; the watchdog of a service that stops is not asked for."""
        self._watchdog.stop()
        if self._server is not None:
            self._server.stop()
