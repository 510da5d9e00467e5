"""From a device's own sample counter to sample numbers of the stream: gaps, duplicates, restarts."""

from __future__ import annotations

from acqd.metering import SampleBlock
from acqd.metering.block import Codes

TRUSTED_NS = 500_000_000
"""A counter that disagrees with the elapsed time by more than this [ns] has been restarted or damaged."""
_UNBROKEN_NS = 20_000_000  # samples this close to their predecessors follow them
_DRIFT = 500e-6  # share of the elapsed time that two free-running clocks may disagree by besides


class SampleNumbering:
    """Places blocks that a device numbers with a counter of samples.

    The counter must not wrap (unwrap it before). As long as it agrees with the elapsed time, a
    jump of the counter is a gap of exactly that many samples and a repeated number a duplicate.
    A counter that starts over is placed by time.
    """

    def __init__(self, rate: float) -> None:
        """`rate` [samples/s] of the device."""
        self._rate = rate
        self._offset: int | None = None  # stream number = counter + offset
        self._next = 0  # stream number of the next sample
        self._next_utc_ns = 0
        self._resumed = False
        self.lost = 0
        """Samples lost so far."""

    def open(self, utc_ns: int, index: int) -> None:
        """The first block begins at `index`, or later by the time since `utc_ns` when `index` > 0."""
        self._offset, self._next, self._next_utc_ns, self._resumed = None, index, utc_ns, index > 0

    def restart(self) -> None:
        """The device's counter has started over: place the next block by time."""
        if self._offset is not None:
            self._offset, self._resumed = None, True

    def place(
        self, codes: Codes, counter: int, utc_ns: int, flags: frozenset[str] = frozenset(), slack_ns: int = 0
    ) -> SampleBlock | None:
        """The block whose first sample has device number `counter` and was taken at `utc_ns`, give or take `slack_ns`.

        None for a duplicate. A block that overlaps the one before loses its known part.
        """
        first = self._locate(counter, utc_ns, slack_ns)
        known = max(0, self._next - first)
        if known >= len(codes):
            return None
        lost = max(0, first - self._next) if self._next else 0
        self.lost += lost
        first, codes = first + known, codes[known:]
        utc_ns += round(known * 1e9 / self._rate)
        self._next = first + len(codes)
        self._next_utc_ns = utc_ns + round(len(codes) * 1e9 / self._rate)
        return SampleBlock(codes, first, utc_ns, lost, flags)

    def _locate(self, counter: int, utc_ns: int, slack_ns: int) -> int:
        """Stream number of the sample that the device calls `counter`."""
        elapsed_ns = utc_ns - self._next_utc_ns
        if self._next and abs(elapsed_ns) < _UNBROKEN_NS:
            elapsed_ns = 0  # a counter that starts over in an unbroken stream of samples costs none of them
        elapsed = round(elapsed_ns * 1e-9 * self._rate)
        if self._offset is not None:
            first = counter + self._offset
            trusted_ns = TRUSTED_NS + slack_ns + _DRIFT * abs(elapsed_ns)
            if abs(first - self._next - elapsed) <= trusted_ns * 1e-9 * self._rate:
                return first
            self._resumed = True
        first = self._next + max(0, elapsed) if self._resumed else self._next
        self._offset = first - counter
        return first
