"""What `acqd run` needs of whatever makes rows: samples that are metered, or meters that are read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from acqd.telemetry.row import PowerRow

Deliver = Callable[[list[PowerRow], list[dict[str, Any]]], None]
"""Takes rows and the 1 s summaries that they complete, in the event loop."""


class Feed(Protocol):
    """Makes rows from `start` to `stop`."""

    @property
    def refused(self) -> list[str]:
        """What this host does not permit, as sentences."""

    async def start(self) -> None:
        """Raises UserError when the source cannot be used."""

    async def run(self) -> None:
        """Until the source ends or `stop` is called."""

    async def stop(self) -> None:
        """Finish the window or the answer that is under way."""

    def close(self) -> None:
        """Release descriptors, threads and processes."""

    def save(self) -> None:
        """Keep on disk what must survive a restart."""

    def alive(self) -> bool:
        """Whether this is sound: rows come, or the device is away and is being called."""

    def status(self) -> dict[str, Any]:
        """For the status topic."""
