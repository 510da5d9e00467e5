"""Rows that were sent and have no receipt yet, by the second in which they were sent."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool import SpooledRow, Stream

_TOGETHER_S = 1.0
_MOST_GROUPS = 64


@dataclass(slots=True)
class _Group:
    """Rows that were sent at about the same time."""

    begun: float
    last: float
    rows: dict[Stream, Ranges] = field(default_factory=dict)

    def remove(self, stream: Stream, first: int, last: int) -> int:
        """Rows first..last of a stream are under way no more; how many of them were."""
        rows = self.rows.get(stream)
        removed = 0 if rows is None else rows.remove(first, last)
        if removed and not rows:
            del self.rows[stream]
        return removed


class InFlight:
    """Memory is bounded: in a long silence, the oldest groups become one."""

    def __init__(self) -> None:
        self._rows: dict[Stream, Ranges] = {}
        self._groups: deque[_Group] = deque()
        self._count = 0
        self.settled_sent = 0.0
        """When the oldest of the rows that were settled last had been sent (monotonic) [s]."""

    def add(self, rows: Sequence[SpooledRow], now: float) -> None:
        """The rows were sent at `now` (monotonic) [s]."""
        if not rows:
            return
        if not self._groups or now - self._groups[-1].begun > _TOGETHER_S:
            self._groups.append(_Group(now, now))
            if len(self._groups) > _MOST_GROUPS:
                self._join_oldest()
        group, under_way = self._groups[-1], self._rows
        group.last, sent = now, group.rows
        for stream, seq, _ in rows:
            if stream not in under_way:
                under_way[stream] = Ranges()
            self._count += under_way[stream].add(seq, seq)
            if stream not in sent:
                sent[stream] = Ranges()
            sent[stream].add(seq, seq)

    def settle(self, stream: Stream, first: int, last: int) -> int:
        """Rows first..last need not be sent again; how many of them were under way."""
        rows = self._rows.get(stream)
        settled = rows.remove(first, last) if rows is not None else 0
        if settled:
            self._count -= settled
            times = [group.last for group in self._groups if group.remove(stream, first, last)]
            self.settled_sent = times[0]
            self._drop_settled()
        return settled

    def oldest_s(self, now: float) -> float:
        """Time since the oldest row under way was sent, to within the second of its group; 0: none is [s]."""
        return max(0.0, now - self._groups[0].last) if self._groups else 0.0

    def overdue(self, now: float, patience_s: float) -> int:
        """Forget rows that were sent longer ago than `patience_s`; how many, so that they are sent again."""
        before = self._count
        while self._groups and now - self._groups[0].last > patience_s:
            for stream, rows in self._groups.popleft().rows.items():
                for first, last in rows:
                    self._count -= self._rows[stream].remove(first, last)
        self._drop_settled()
        return before - self._count

    def clear(self) -> None:
        """Forget all: the connection has ended, or a sink has just come."""
        self._rows.clear()
        self._groups.clear()
        self._count = 0

    def sent(self, stream: Stream, seq: int) -> bool:
        """Whether the row is under way."""
        rows = self._rows.get(stream)
        return rows is not None and seq in rows

    def __len__(self) -> int:
        """Rows under way."""
        return self._count

    def _drop_settled(self) -> None:
        """The oldest group is one with rows."""
        while self._groups and not self._groups[0].rows:
            self._groups.popleft()

    def _join_oldest(self) -> None:
        older, newer = self._groups.popleft(), self._groups[0]
        for stream, rows in older.rows.items():
            into = newer.rows.setdefault(stream, Ranges())
            for first, last in rows:
                into.add(first, last)
