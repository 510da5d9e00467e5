"""The health of `acqd run`: its feed and its delivery."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from acqd import __version__
from acqd.daemon.feed import Feed
from acqd.daemon.health.capture import CAPTURE, CapturePage
from acqd.daemon.health.section import HealthSection
from acqd.daemon.health.service import ServiceHealth
from acqd.daemon.health.snapshot import Archive, Delivery, Link, Snapshot
from acqd.daemon.health.window import WINDOW, window_page

_TURN_S = 5.0  # without a turn of the event loop: it is blocked, and no row gets through it


@dataclass(frozen=True, slots=True)
class Progress:
    """What the service has done so far."""

    rows: int
    delivery: Delivery | None = None
    broker: Link | None = None
    archive: Archive | None = None


class DaemonHealth(ServiceHealth):
    """Of a daemon whose event loop has to turn, and whose rows have to advance."""

    def __init__(
        self,
        section: HealthSection,
        device: str,
        feed: Feed,
        progress: Callable[[], Progress],
        certificates: Sequence[Path | None] = (),
    ) -> None:
        self._device, self._feed, self._progress = device, feed, progress
        self._capture = CapturePage(lambda device, seconds: feed.capture(device, seconds))
        pages = {CAPTURE: self._capture.page, WINDOW: window_page(feed.window)}
        super().__init__(section.host, section.port, pages, certificates)

    def start(self) -> None:
        """Open the port, in the event loop of the feed."""
        self._capture.loop = asyncio.get_running_loop()
        super().start()

    def alive(self) -> bool:
        """Whether rows advance, or what they need is away and being brought back."""
        return self.standstill_s < _TURN_S and self._feed.alive()

    def snapshot(self) -> Snapshot:
        """The daemon now."""
        feed, progress = self._feed.health(), self._progress()
        return Snapshot(
            service="daemon",
            name=self._device,
            version=__version__,
            uptime_s=self.uptime_s,
            alive=self.alive(),
            rows=progress.rows,
            last_row_age_s=feed.last_row_age_s,
            boot=feed.boot,
            source=feed.source,
            broker=progress.broker,
            delivery=progress.delivery,
            archive=progress.archive,
            cycles=feed.cycles,
            synchronised=feed.synchronised,
            windows=feed.windows,
            boxes=feed.boxes,
            register_trouble=feed.register_trouble,
            acknowledged=self.acknowledged,
            certificate_trouble=self.certificate_trouble,
        )
