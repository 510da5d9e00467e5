"""Rows that the broker has acknowledged, until it is known that it takes rows.

An access rule may refuse rows that the broker acknowledges: MQTT 3.1.1 has no other answer.
"""

from __future__ import annotations

from collections.abc import Iterable

from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool import Stream

Rows = dict[Stream, Ranges]


class Acknowledgements:
    """Where a row is delivered when the broker has it; for one event loop."""

    def __init__(self) -> None:
        self._rows: Rows = {}
        self._asked: list[Rows] = []
        self._in_doubt = False

    def add(self, sent: Iterable[tuple[Stream, int]]) -> None:
        """The broker has acknowledged these rows."""
        for stream, seq in sent:
            self._rows.setdefault(stream, Ranges()).add(seq, seq)

    def doubt(self) -> None:
        """From now on, rows wait until it is known that the broker takes them."""
        self._in_doubt = True

    def ask(self) -> None:
        """The question whether the broker takes rows goes out now: it is about those acknowledged until now."""
        if self._rows:
            self._asked.append(self._rows)
            self._rows = {}

    def taken(self) -> list[Rows]:
        """The broker took rows when it was asked, or cannot be asked: what was asked for."""
        asked, self._asked = self._asked, []
        return asked

    def believed(self) -> list[Rows]:
        """What counts as taken because it is acknowledged: nothing while that is in doubt."""
        if self._in_doubt or not self._rows:
            return []
        rows, self._rows = self._rows, {}
        return [rows]

    def clear(self) -> None:
        """The broker has not taken them."""
        self._rows.clear()
        self._asked.clear()

    def __len__(self) -> int:
        """Rows that wait for an answer."""
        return sum(len(rows) for streams in (self._rows, *self._asked) for rows in streams.values())
