"""How the source is, as the daemon says it: in the log when that changes, and in the status."""

from __future__ import annotations

from dataclasses import replace

from acqd.changes import StateLog
from acqd.sources.base import SourceHealth


class SourceWatch:
    """Keeps the newest health of a source."""

    def __init__(self, says: StateLog) -> None:
        self._says = says
        self.health = SourceHealth()

    def update(self, health: SourceHealth | None) -> None:
        """What MAIN_FAST reports; None: nothing new."""
        if health is None:
            return
        if not health.connected:
            self._says.trouble("source", "lost", f"{health.reason}; trying again")
        elif health.reason:
            self._says.trouble("source", health.reason, health.reason)
        else:
            self._says.fine("source", "is back; the gap is flagged")
        self.health = health

    def lose(self, reason: str) -> None:
        """There is no MAIN_FAST that could report."""
        self.health = replace(self.health, connected=False, reason=reason)
