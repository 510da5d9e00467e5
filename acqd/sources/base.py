"""The one interface between MAIN_FAST and whatever delivers samples."""

from __future__ import annotations

from abc import ABC, abstractmethod

from acqd.metering import SampleBlock, StreamFormat


class Source(ABC):
    """A stream of samples that can be opened once."""

    form: StreamFormat
    """Known before `open`."""
    live: bool = True
    """Samples are taken now: their time follows this computer's UTC. False: a recording's own time."""
    flags: frozenset[str] = frozenset()
    """Row flags that hold for the whole stream ("simulated")."""

    @abstractmethod
    def open(self, utc_ns: int, index: int = 0) -> None:
        """Begin at sample number `index`, taken at `utc_ns` (a recording may know better)."""

    @abstractmethod
    def read(self, limit: int) -> SampleBlock | None:
        """At most `limit` samples that are there now; None when the stream has ended.

        Never blocks. A block may be empty. Lost samples show as a jump of `index`.
        """

    def skip(self, count: int) -> None:
        """Give up `count` samples: they become a gap."""
        while count > 0:
            self.read(min(count, 100_000))
            count -= 100_000

    def close(self) -> None:
        """Let go of files and devices; allowed at any time."""
        return
