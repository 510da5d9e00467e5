"""The interface between `acqd run` and what makes its rows: metered samples, or meters that are read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from acqd.daemon.health.snapshot import FeedHealth
from acqd.plc.fast_process import Spawn
from acqd.plc.recent import SampledWindow
from acqd.sources.waveform import Waveform
from acqd.telemetry.last_rows import Known
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Readings

if TYPE_CHECKING:  # libsndfile is loaded only where samples are kept
    from acqd.archive.recorder import Recorder

Deliver = Callable[[list[PowerRow], list[dict[str, Any]], Readings | None], None]
"""Takes rows, the 1 s summaries that they complete and the registers after them, in the event loop."""


class Sent(Protocol):
    """What is known of the rows of earlier starts."""

    def readings(self, device: str) -> Readings | None:
        """The registers after the last row that an earlier start has spooled."""

    async def last_rows(self, device: str) -> Known | None:
        """What a sink and the broker know of the last rows before a power cut; None: there was none."""

    def unread(self, device: str) -> list[LastRow]:
        """The last row of each channel that an earlier start has spooled without the registers after it."""


@dataclass(frozen=True, slots=True)
class Company:
    """What a feed shares with others of a daemon."""

    name: str = ""
    """Of the feed in the log; "" where there is one only."""
    spawn: Spawn | None = None
    """Starts processes of MAIN_FAST; None: each in a fresh interpreter."""
    archive: Recorder | None = None
    """Keeps the samples of all of them."""


ALONE = Company()


class Feed(Protocol):
    """Makes rows from `start` to `stop`."""

    @property
    def refused(self) -> list[str]:
        """Real-time settings that this host does not permit, as sentences."""

    async def start(self) -> None:
        """Reach the source and start. Raises UserError when it cannot be used."""

    async def run(self) -> None:
        """Make rows until the source ends or `stop` is called."""

    async def stop(self) -> None:
        """End after the window or reading in progress."""

    def close(self) -> None:
        """Release descriptors, threads and processes."""

    def save(self) -> None:
        """Write to disk what must survive a restart."""

    def alive(self) -> bool:
        """Whether rows arrive, or the device is lost and reconnection is being tried; never waits."""

    def health(self) -> FeedHealth:
        """Connection to the source, cycles and clock; asked in the threads of the health endpoints."""

    def window(self, device: str) -> tuple[str, SampledWindow | None] | None:
        """Name and newest window of a device ("": the first one); None: it is not of this feed. In any thread."""

    def capture(self, device: str, seconds: float) -> Waveform | None:
        """The newest samples of a device ("": the first one), in the event loop only; None: it has no samples."""

    def status(self) -> dict[str, Any]:
        """The source's part of the status message."""
