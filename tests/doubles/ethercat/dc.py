"""Distributed clock of one slave: receive times, system time and the SYNC unit (ET1100 data sheet, Section I, 9)."""

from __future__ import annotations

from .clock import Clock
from .registers import (
    DC_ACTIVATION,
    DC_CYCLE0,
    DC_CYCLE1,
    DC_DELAY,
    DC_OFFSET,
    DC_PROCESSING,
    DC_RECEIVE,
    DC_START,
    DC_SYSTEM,
    U32,
    U64,
)

HOP_NS = 150
"""Delay of a frame from one slave to the next, assumed equal in both directions."""
MASK64 = (1 << 64) - 1


class DistributedClock:
    """Local time is the oscillator's time plus `epoch` [ns]; system time adds what the master wrote as offset."""

    def __init__(self, memory: bytearray, clock: Clock, epoch: int) -> None:
        self._memory = memory
        self._clock = clock
        self._epoch = epoch
        self.hops = 0
        """Slaves before this one."""
        self.followers = 0
        """Slaves behind this one."""
        self.start: int | None = None
        """Time of the oscillator at the first SYNC pulse, or None: no pulses."""
        self.cycle0 = 0
        self.cycle1 = 0

    def latch(self) -> None:
        """Keep the time at which the frame passes each port: 0 on the way out, 1 on the way back."""
        local = self._clock.now() + self._epoch + self.hops * HOP_NS
        back = local + 2 * self.followers * HOP_NS if self.followers else 0
        for port, value in enumerate((local, back, 0, 0)):
            U32.pack_into(self._memory, DC_RECEIVE + 4 * port, value & 0xFFFFFFFF)
        U64.pack_into(self._memory, DC_PROCESSING, local & MASK64)

    def show_time(self) -> None:
        """Put the present system time [ns] into its register."""
        U64.pack_into(self._memory, DC_SYSTEM, (self._clock.now() + self.shift) & MASK64)

    @property
    def shift(self) -> int:
        """System time minus the oscillator's time [ns], modulo 2^64.

        Offset and delay act at once, as if the control loop of the clock had settled already.
        """
        offset: int = U64.unpack_from(self._memory, DC_OFFSET)[0]
        delay: int = U32.unpack_from(self._memory, DC_DELAY)[0]
        return self._epoch + offset + delay

    def activate(self) -> None:
        """Act on the activation register: pulses begin at the start time, never if that has passed already."""
        self.start = None
        wanted = self._memory[DC_ACTIVATION]
        if not wanted & 0x01:
            return
        self.cycle0 = U32.unpack_from(self._memory, DC_CYCLE0)[0] if wanted & 0x02 else 0
        self.cycle1 = U32.unpack_from(self._memory, DC_CYCLE1)[0] if wanted & 0x04 else 0
        ahead = (U64.unpack_from(self._memory, DC_START)[0] - self._clock.now() - self.shift) & MASK64
        if self.cycle0 and 0 < ahead < 1 << 63:
            self.start = self._clock.now() + ahead

    def waiting(self) -> bool:
        """Whether the SYNC unit is on and its first pulse is still to come."""
        return self.start is not None and self._clock.now() < self.start

    def newest_block(self) -> int:
        """Number of the newest complete block since the first pulse; negative: none is complete."""
        if self.start is None:
            return -1
        return (self._clock.now() - self.start) // (self.cycle0 + self.cycle1) - 1

    def reset(self) -> None:
        """Power-on: the local time begins at zero."""
        self._epoch = -self._clock.now()
        self.start = None
