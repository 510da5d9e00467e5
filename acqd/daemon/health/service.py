"""What the health of every service has in common: endpoints, watchdog, and a loop that has to turn."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path

from acqd.daemon.health.server import HealthServer, Page
from acqd.daemon.health.snapshot import Acknowledged, Delivery, Snapshot
from acqd.daemon.health.watchdog import Watchdog
from acqd.telemetry import certificates

_LOOK_S = 3_600.0


class ServiceHealth(ABC):
    """Asked by threads: everything here reads plain attributes and never waits."""

    def __init__(
        self,
        host: str,
        port: int,
        pages: Mapping[str, Page] | None = None,
        certificates: Sequence[Path | None] = (),
    ) -> None:
        """Port 0: no endpoints. `pages`: those that only this service has. `certificates`: those that it needs."""
        self._certificates, self._certificates_seen = certificates, (-1e9, "")
        self._begun = self._turned = time.monotonic()
        self.acknowledged = Acknowledged()
        self._server = HealthServer(host, port, self.snapshot, pages, self._acknowledge) if port else None
        self._watchdog = Watchdog(self.alive)

    @abstractmethod
    def alive(self) -> bool:
        """Whether the service does its work, or waits for something that is known to be away."""

    @abstractmethod
    def snapshot(self) -> Snapshot:
        """The service now."""

    def start(self) -> None:
        """Open the port and feed the watchdog."""
        self.turned()
        self._watchdog.start()
        if self._server is not None:
            self._server.start()

    @property
    def certificate_trouble(self) -> str:
        """Which certificate ends soon, as it was within the last hour; else empty."""
        now = time.monotonic()
        if now - self._certificates_seen[0] > _LOOK_S:
            self._certificates_seen = now, certificates.trouble(self._certificates)
        return self._certificates_seen[1]

    def _acknowledge(self) -> None:
        """A person has seen what was counted until now."""
        now = self.snapshot()
        way = now.delivery or Delivery()
        self.acknowledged = Acknowledged(
            way.dropped, now.quarantined or 0, now.recalls + way.gone_back, way.deleted, way.cuts_unconfirmed
        )

    def turned(self) -> None:
        """The loop of the service turns; called by it."""
        self._turned = time.monotonic()

    def stop(self) -> None:
        """Close the port; the watchdog of a service that stops is not asked for."""
        self._watchdog.stop()
        if self._server is not None:
            self._server.stop()

    @property
    def uptime_s(self) -> float:
        """Time since the service was made [s]."""
        return time.monotonic() - self._begun

    @property
    def standstill_s(self) -> float:
        """Time since the last turn of the loop [s]."""
        return time.monotonic() - self._turned
