"""Time that no clock setting changes: since the start of the computer, suspended time included, with the start's id.

Two moments of one start have an exact distance. Of a moment of an earlier start, only the order is known: it is
at least as old as this start (Linux: CLOCK_BOOTTIME of clock_gettime(2), /proc/sys/kernel/random/boot_id). Where the
id is hidden (ProcSubset=pid of systemd), a distance is a lower bound.
"""

from __future__ import annotations

import time
import uuid
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class Moment(NamedTuple):
    """A point in time of one start of the computer."""

    start: bytes
    """Id of the start, 16 bytes."""
    ns: int
    """Since that start [ns]."""

    def age_s(self, now: Moment) -> float:
        """Time from here to `now` [s]; of an earlier start, the least that it can be."""
        same = self.start == now.start and self.ns <= now.ns
        return (now.ns - self.ns if same else now.ns) / 1e9


def moment() -> Moment:
    """Now."""
    return Moment(start_id(), time.clock_gettime_ns(time.CLOCK_BOOTTIME))


@lru_cache(maxsize=1)
def start_id() -> bytes:
    """Id of this start of the computer; zeros where it is hidden."""
    try:
        return uuid.UUID(_BOOT_ID.read_text(encoding="ascii").strip()).bytes
    except (OSError, ValueError):
        return bytes(16)
