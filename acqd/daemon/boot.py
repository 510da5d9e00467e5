"""The boot in the rows: within one boot, time only rises."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from acqd.telemetry.row import PowerRow


class Boot:
    """Numbers the pieces of a daemon's run between which the clock has been set back.

    A small step back never reaches the rows (acqd.plc.clock). A large one would make time ambiguous: the rows after it
    carry the boot with `.1`, `.2` ... appended, so that (boot, time) stays unique and in order.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        """Boot of the newest rows."""
        self._first, self._pieces = name, 0
        self._last: dict[tuple[str, str], int] = {}

    def state(self) -> dict[str, Any]:
        """What the boot of the next rows depends on, as JSON."""
        last = [[*stream, filetime] for stream, filetime in self._last.items()]
        return {"first": self._first, "pieces": self._pieces, "last": last}

    @classmethod
    def of(cls, state: dict[str, Any]) -> Boot:
        """Goes on where `state` was taken. Raises ValueError."""
        try:
            boot = cls(str(state["first"]))
            boot._pieces = int(state["pieces"])
            boot._last = {(str(device), str(channel)): int(ticks) for device, channel, ticks in state["last"]}
        except (KeyError, TypeError) as error:
            raise ValueError(f"no state of a boot: {error!r}") from None
        if boot._pieces:
            boot.name = f"{boot._first}.{boot._pieces}"
        return boot

    def stamp(self, rows: Sequence[PowerRow]) -> None:
        """Set the boot of rows that follow the rows stamped before."""
        for row in rows:
            stream = (row.device, row.channel)
            if row.filetime < self._last.get(stream, 0):
                self._pieces += 1
                self.name = f"{self._first}.{self._pieces}"
                self._last.clear()
            self._last[stream] = row.filetime
            row.boot = self.name
