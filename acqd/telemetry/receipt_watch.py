"""Which sinks are there, how long their receipts take, and how many rows may be sent ahead of them."""

from __future__ import annotations

from collections.abc import Callable

from acqd.telemetry.in_flight import InFlight
from acqd.telemetry.patience import LONGEST_S, Patience

AHEAD = 4_096
"""Rows of the backlog that are sent ahead of their receipts, while a sink is there."""
_PROBE = 64
"""The same while no sink is known: one may be there and not have said so."""
_QUIET_S = 1.0
"""The backlog pauses so long while a sink works through what the broker had kept for it."""
_LATELY_S = 10.0
"""How long the longest wait for a receipt is remembered: a sink that commits every 3 s is late all the time."""


class ReceiptWatch:
    """Of the rows under way; for one event loop."""

    def __init__(self, flying: InFlight, now: Callable[[], float]) -> None:
        self._flying, self._now = flying, now
        self._online = False
        self._alone_since = -1e9
        self._sinks: set[str] = set()
        self._heard = self._unreceipted_since = -1e9
        self._quiet_until = -1e9
        self._patience = Patience()
        self._waited = (-1e9, 0.0)
        self.seen = False
        """Whether a sink has ever announced itself or sent a receipt."""

    def begin(self) -> None:
        """A new connection: sinks that are there say so again."""
        self._online, self._alone_since = True, self._now()
        self._sinks.clear()

    def end(self) -> None:
        """The connection has ended."""
        self._online = False

    def came(self, sink: str) -> None:
        """A sink has announced itself."""
        self._sinks.add(sink)
        self.seen = True
        self._patience, self._waited = Patience(), (-1e9, 0.0)

    def left(self, sink: str) -> bool:
        """A sink is offline; whether others are there."""
        self._sinks.discard(sink)
        if not self._sinks:
            self._alone_since = self._now()
        return bool(self._sinks)

    @property
    def sinks(self) -> frozenset[str]:
        """Status topics of the sinks that say that they are there."""
        return frozenset(self._sinks)

    def sending(self) -> None:
        """Rows are about to be sent."""
        if not len(self._flying):
            self._unreceipted_since = self._now()

    def receipt_comes(self) -> None:
        """A receipt is about to be taken."""
        self._note_wait(self._flying.oldest_s(self._now()))

    def receipt_came(self, removed: int, expected: int, sent: float) -> None:
        """A receipt has taken `removed` rows out of the spool, of which `expected` were under way, since `sent`."""
        now = self._now()
        self._heard, self.seen = now, True
        if expected:
            self._unreceipted_since = now
            self._patience.answered(now - sent)
        if removed > expected:
            self._quiet_until = now + _QUIET_S

    def overdue(self) -> int:
        """Forget rows whose receipt has not come in time, so that they are sent again; how many."""
        late = self._flying.overdue(self._now(), self._patience.s)
        if late:
            self._note_wait(self._patience.s)
            self._patience.missed()
        return late

    def allowed(self) -> int:
        """Rows of the backlog that may be sent now; not positive: none."""
        now = self._now()
        if now < self._quiet_until:
            return 0
        known = bool(self._sinks) or now - self._heard < LONGEST_S
        return (AHEAD if known else _PROBE) - len(self._flying)

    @property
    def unreceipted_s(self) -> float:
        """How long no receipt has come for rows that were sent, while a sink says that it is there [s]."""
        if not self._online or not self._sinks or not len(self._flying):
            return 0.0
        return max(0.0, self._now() - self._unreceipted_since)

    @property
    def alone_s(self) -> float:
        """How long there is a connection, no sink says that it is there, and no receipt comes [s]."""
        if not self._online or self._sinks:
            return 0.0
        return max(0.0, self._now() - max(self._alone_since, self._heard))

    @property
    def lag_s(self) -> float:
        """How long the oldest row has waited for its receipt while a sink says that it is there [s].

        The longest wait of the last 10 s, of rows that have their receipt, too.
        """
        if not self._online or not self._sinks:
            return 0.0
        now, (waited_at, waited_s) = self._now(), self._waited
        return max(self._flying.oldest_s(now), waited_s if now - waited_at < _LATELY_S else 0.0)

    def _note_wait(self, waited_s: float) -> None:
        """A row had waited so long when its receipt came, or when it was sent again."""
        now, (waited_at, longest_s) = self._now(), self._waited
        if self._sinks and (waited_s >= longest_s or now - waited_at >= _LATELY_S):
            self._waited = now, waited_s
