"""Rows that a changed table refuses: they wait with their daemons, a copy is in quarantine, and a person is asked.

No receipt follows, so the daemon sends them again until the table takes them. The copy is for rows that nobody sends
again: of a recording that is played back, or of a daemon that trusts the broker.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from typing import TypeAlias

import sqlalchemy as sa

from acqd.storage import quarantining
from acqd.storage.allowance import Allowance
from acqd.storage.received import Message

_log = logging.getLogger(__name__)
REFUSED = "the database refuses it: "
"""How the reasons of such copies begin."""
Waiting: TypeAlias = tuple[Message, str, str]
"""A message, its device, and why the database refuses it."""
_SAID_S = 150.0
"""A daemon sends a row without a receipt again within a minute."""
_FULL_S = 3_600.0
_NAMED = 3
_FULL = (
    "The quarantine has taken its bytes of a day ([sink] quarantine_mb_per_day): of further ones there is no copy, and "
    "those that nobody sends again are lost"
)


class Refusals:
    """Of one sink; for one thread, others read `trouble`."""

    def __init__(self, bytes_per_day: float, now: Callable[[], float] = time.monotonic) -> None:
        """`bytes_per_day`: of copies that are kept."""
        self._allowance, self._now = Allowance(bytes_per_day), now
        self._said: dict[str, tuple[float, str]] = {}
        self._full_until = -1e9
        self.copies = True
        """Whether copies may be in quarantine: unknown at the start."""

    @property
    def trouble(self) -> str:
        """Whose rows wait, and why, else empty."""
        now = self._now()
        said = {device: why for device, (until, why) in list(self._said.items()) if until >= now}
        if not said:
            return ""
        devices, more = sorted(said)[:_NAMED], len(said) - _NAMED
        names = ", ".join(devices) + (f" and {more} more" if more > 0 else "")
        return (
            f"the database refuses rows of {names}: {said[devices[0]]}; they wait, others are stored: what was changed "
            "in its tables?"
        ) + (f" {_FULL}" if now < self._full_until else "")

    def keep(self, connection: sa.Connection, waiting: Sequence[Waiting]) -> None:
        """Copies into quarantine, as far as the bytes of a day allow. Raises as `quarantining.insert`."""
        fitting = self._allowance.fitting([min(len(one.payload), quarantining.PAYLOAD_KEPT) for one, _, _ in waiting])
        copies = [(message, f"{REFUSED}{why}") for message, _, why in waiting[:fitting]]
        self._allowance.spend(quarantining.insert(connection, copies))
        self.copies = True
        if fitting < len(waiting):
            now = self._now()
            if now >= self._full_until:
                _log.error("refused rows: %s", _FULL)
            self._full_until = now + _FULL_S

    def note(self, waiting: Sequence[Waiting]) -> None:
        """These wait now."""
        now = self._now()
        said = {device: (until, why) for device, (until, why) in self._said.items() if until >= now}
        said |= {device: (now + _SAID_S, why) for _, device, why in waiting}
        self._said = said
