"""When a slot of the ring is complete: a function of the time, or of the number of reads."""

from __future__ import annotations

import time
from datetime import UTC, datetime

DC_EPOCH_UNIX_NS = 946_684_800 * 10**9
"""2000-01-01, the epoch of EtherCAT distributed clocks, in Unix time [ns]."""
_LOCKSTEP_DC_START = int(datetime(2024, 1, 1, tzinfo=UTC).timestamp()) * 10**9 - DC_EPOCH_UNIX_NS


class SlotClock:
    """Counts the cycles of the terminal, and from them the sequence number that the PLC has reached.

    A cycle lasts `slot_ns` of DC time. The terminal counts every cycle; the PLC's program can be
    frozen, and starts its sequence numbers again at a restart.
    """

    def __init__(self, slot_ns: int, dc_start: int) -> None:
        self.slot_ns = slot_ns
        self._dc_start = dc_start
        self._origin = 0  # cycles before the slot with the sequence number 1
        self._frozen_at: int | None = None

    def cycles(self, now: float) -> int:
        """Complete cycles of the terminal since the double's start, at `now` [s of time.monotonic]."""
        raise NotImplementedError

    def head_was_read(self) -> None:
        """A client is about to read the head (lockstep time advances)."""

    def latest(self, now: float) -> int:
        """The sequence number that the PLC has reached at `now`, 0 before the first slot."""
        cycles = self.cycles(now) if self._frozen_at is None else self._frozen_at
        return max(cycles - self._origin, 0)

    @property
    def frozen(self) -> bool:
        return self._frozen_at is not None

    def freeze(self, now: float) -> None:
        if self._frozen_at is None:
            self._frozen_at = self.cycles(now)

    def unfreeze(self) -> None:
        """The sequence number goes on from the present cycle: those of the pause are left out."""
        self._frozen_at = None

    def restart(self, now: float) -> None:
        """The next slot has the sequence number 1."""
        self._origin = self.cycles(now)
        if self._frozen_at is not None:
            self._frozen_at = self._origin

    def cycle_of(self, seq: int) -> int:
        """The terminal's cycle that the slot `seq` holds, counted from 0."""
        return self._origin + seq - 1

    def dc_time(self, seq: int) -> int:
        """DC time [ns since 2000-01-01] of the first sample of the slot `seq`."""
        return self._dc_start + self.cycle_of(seq) * self.slot_ns


class RealClock(SlotClock):
    """DC time runs as CLOCK_MONOTONIC times (1 + `drift_ppm` / 1e6): a positive drift is a fast PLC."""

    def __init__(self, slot_ns: int, drift_ppm: float = 0.0) -> None:
        super().__init__(slot_ns, time.time_ns() - DC_EPOCH_UNIX_NS)
        self._start = time.monotonic()
        self._cycles_per_second = (1 + drift_ppm * 1e-6) * 1e9 / slot_ns

    def cycles(self, now: float) -> int:
        return int((now - self._start) * self._cycles_per_second)


class LockstepClock(SlotClock):
    """Time advances by `advance` cycles just before each read of the head: deterministic."""

    def __init__(self, slot_ns: int, advance: int = 20) -> None:
        super().__init__(slot_ns, _LOCKSTEP_DC_START)
        self.advance = advance
        self._cycles = 0

    def cycles(self, now: float) -> int:
        return self._cycles

    def head_was_read(self) -> None:
        self._cycles += self.advance
