"""Keeps the thread of a meter bus alive: launched again for ever, with growing pauses, whatever ends it."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from acqd.changes import StateLog
from acqd.retry import Backoff

if TYPE_CHECKING:  # needs acqd[hw], which a PC without hardware does not have
    from acqd.sources.meters import MeterBus, Reading

_log = logging.getLogger(__name__)
_SUBJECT = "meter bus"


class BusSupervisor:
    """`watch` is called several times a second; missed rounds are a hole in seq and a flag of the next row."""

    def __init__(self, bus: MeterBus, on_reading: Callable[[Reading], None], of: str = "") -> None:
        """`on_reading` is called in the thread of the bus; `of` names its meters where there are several buses."""
        self._bus, self._on_reading = bus, on_reading
        self._says, self._backoff = StateLog(_log, of=of), Backoff()
        self._begun = self._due = 0.0
        self.restarts = 0
        """Launches after the first."""
        self.trouble = ""
        """Why the thread ended; empty again when readings arrive."""

    def start(self) -> None:
        """Launch the thread."""
        self._begun = time.monotonic()
        self._bus.start(self._on_reading)

    def watch(self) -> None:
        """Launch the thread again when it has ended and the pause is over."""
        if self._bus.polling:
            return
        now = time.monotonic()
        if not self._due:
            self.trouble = f"its thread ended ({self._bus.failure or 'no reason known'})"
            self._says.trouble(_SUBJECT, "ended", f"{self.trouble}; relaunching it, missed rounds will be flagged")
            self._backoff.ended(now - self._begun)
            self._due = now + self._backoff.pause_s()
        elif now >= self._due:
            self._due = 0.0
            self.restarts += 1
            self.start()

    def delivered(self) -> None:
        """A reading has arrived."""
        if self.trouble and self._bus.polling:
            self.trouble = ""
            self._says.fine(_SUBJECT, "delivers again")
