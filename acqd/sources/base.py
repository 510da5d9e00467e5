"""The one interface between MAIN_FAST and whatever delivers samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.block import Codes

CYCLE_NS = 1_000_000
"""Cycle of MAIN_FAST unless the source asks for another [ns]."""


@dataclass(frozen=True, slots=True)
class SourceHealth:
    """What the daemon says about its source: in the log when it changes, and in the status topic."""

    connected: bool = True
    """False: the device is out of reach and the source tries again by itself."""
    reason: str = ""
    """Why not, and what to do; or what is wrong with samples that do arrive. One line."""
    lost: int = 0
    """Samples lost since the start (each loss is a gap in the stream)."""
    reconnects: int = 0
    """Times the device came back."""


class Source(ABC):
    """A stream of samples that can be opened once.

    The order of calls is `connect`, `open`, then every `period_ns` one `exchange` and `read` until
    nothing is left, and at last `close`.
    """

    form: StreamFormat
    """Known after `connect`."""
    live: bool = True
    """Samples are taken now: their time follows this computer's UTC. False: a recording's own time."""
    paced: bool = True
    """MAIN_FAST asks for the samples that the elapsed time is worth. False: a device with its own
    sampling clock, which gives whatever it has."""
    period_ns: int = CYCLE_NS
    """How often `exchange` must be called [ns]; known after `connect`."""
    patience_s: float = 3.0
    """An exchange that takes longer than this [s] hangs: MAIN_FAST is killed and relaunched. Known after `connect`."""
    flags: frozenset[str] = frozenset()
    """Row flags that hold for the whole stream ("simulated")."""

    def connect(self) -> None:
        """Reach the device and learn `form` and `period_ns`. Raises UserError with what to do."""
        return

    @abstractmethod
    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start at sample number `index`, taken at `utc_ns` (a recording may know better).

        A device that is resumed (`index` > 0) places its first sample by the time that has passed since.
        """

    def exchange(self) -> None:
        """One cycle's exchange with the device: its new samples are ready for `read`.

        Waits for an answer on the wire at most, never for samples. A device that is lost is no
        exception: `health` says why, and the source reconnects by itself.
        """
        return

    @abstractmethod
    def read(self, limit: int) -> SampleBlock | None:
        """At most `limit` samples that are there now; None when the stream has ended.

        Never waits. A block may be empty. Lost samples show as a jump of `index`.
        """

    def ahead(self, limit: int) -> Codes | None:
        """At most `limit` of the samples that `read` would give next, where a paced source has them already.

        They have the flags of the last block. Whoever takes some of them says so with `skip`.
        """
        del limit
        return None

    def skip(self, count: int) -> None:
        """Go on by `count` samples of a paced source. Unless they were taken from `ahead`, they become a gap."""
        while count > 0:
            self.read(min(count, 100_000))
            count -= 100_000

    def health(self) -> SourceHealth:
        """Connection and losses so far."""
        return _HEALTHY

    def correction_ns(self) -> int:
        """Shift of the next wake-up [ns], for a source that locks MAIN_FAST to its device's clock."""
        return 0

    def close(self) -> None:
        """Let go of files and devices; allowed at any time."""
        return


_HEALTHY = SourceHealth()
