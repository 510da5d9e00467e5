"""How many windows a source has delivered, and how many of them with which flag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from acqd.daemon.health.snapshot import Windows
from acqd.telemetry.row import PowerRow

_DESCRIBE = frozenset({"simulated", "test", "derived", "rms_meter"})
"""Flags of the whole stream: they say where its rows are from, and nothing about a window."""
_CLOCK = "unsynchronised"
"""Counted by its name only: it says nothing about values, and the clock has a line of its own."""


class Tally:
    """Counts windows of rows as they are made."""

    def __init__(self) -> None:
        self._windows = self._flagged = 0
        self._flags: Counter[str] = Counter()

    def add(self, rows: Sequence[PowerRow]) -> None:
        """Rows of one or several windows; the rows of a window are neighbours. A flag of any phase counts once."""
        window: tuple[str, int] | None = None
        flags: set[str] = set()
        for row in rows:
            if window != (row.device, row.seq):
                self._count(flags)
                window, flags = (row.device, row.seq), set()
                self._windows += 1
            flags.update(row.flags)
        self._count(flags)

    def total(self) -> Windows:
        """The counts so far; in any thread."""
        return Windows(self._windows, self._flagged, dict(self._flags))

    def _count(self, flags: set[str]) -> None:
        told = flags - _DESCRIBE
        if not told:
            return
        self._flags = self._flags + Counter(told)  # another object: readers in threads never see it change
        self._flagged += told != {_CLOCK}
