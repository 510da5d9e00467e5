"""Rows that were never published: no sink can have stored them, whatever a receipt says.

Somebody else who publishes rows with the keys of ours gets receipts for them. Such a receipt must not delete rows of
ours that nobody has seen: they are sent, and the sink puts them into quarantine and reports the conflict.
"""

from __future__ import annotations

from collections.abc import Iterable

from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool import SpooledRow, Stream


class Unsent:
    """Rows of this process that have not left it; memory grows with the number of ranges."""

    def __init__(self) -> None:
        self._rows: dict[Stream, Ranges] = {}

    def add(self, rows: Iterable[SpooledRow]) -> None:
        """These rows are new."""
        for row in rows:
            waiting = self._rows.get(row.stream)
            if waiting is None:
                waiting = self._rows[row.stream] = Ranges()
            waiting.add(row.seq, row.seq)

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._rows)

    def publish(self, leaving: Iterable[SpooledRow]) -> None:
        """These rows leave."""
        for stream, seq, _ in leaving:
            if (rows := self._rows.get(stream)) is not None and rows.remove(seq, seq) and not rows:
                del self._rows[stream]

    def without(self, stream: Stream, first: int, last: int) -> Iterable[tuple[int, int]]:
        """The parts of first..last that hold no row of these."""
        rows = self._rows.get(stream)
        if rows is None:
            return [(first, last)]
        rest = Ranges([(first, last)])
        for pair in rows:
            rest.remove(*pair)
        return rest
