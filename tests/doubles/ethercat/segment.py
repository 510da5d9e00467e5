"""The segment: coupler and terminals, the time that frames make pass, and the faults that concern the cable."""

from __future__ import annotations

from collections.abc import Sequence

from .clock import RealClock, VirtualClock
from .esc import SlaveController
from .objects import Firmware
from .ring import LRD, LRW, Datagram, execute, parse
from .terminal import EL3783_PRODUCT, Coupler, PowerTerminal

IDLE_NS = 10_000
"""Virtual time that a frame without process data takes while all terminals wait for their first SYNC pulse [ns].

Before that the virtual time stands still, so that the terminals which a master starts one after another begin together.
"""


class Segment:
    """One EK1100 with `terminals` EL3783; the first has the product code `product`.

    With a VirtualClock each frame that reads the first present terminal's inputs lets `advance_ns` pass, or without
    that the duration of one block: it delivers exactly one new block.
    """

    def __init__(
        self,
        clock: VirtualClock | RealClock,
        terminals: int = 1,
        *,
        advance_ns: int | None = None,
        product: int = EL3783_PRODUCT,
        firmware: Firmware | None = None,
    ) -> None:
        self.clock = clock
        self._advance = advance_ns
        self.terminals = [
            PowerTerminal(k, clock, product if k == 0 else EL3783_PRODUCT, firmware) for k in range(terminals)
        ]
        self._coupler = Coupler(clock)
        self._present = terminals
        self.connected = True
        self.drops = 0
        self.repeats = 0
        self.frames = 0
        self.link(terminals)

    def link(self, present: int) -> None:
        """Keep the first `present` terminals on the bus; the others no longer touch frames."""
        self._present = present
        self._slaves: list[SlaveController] = [self._coupler, *self.terminals[:present]]
        for position, slave in enumerate(self._slaves):
            slave.set_links(position, len(self._slaves) - 1 - position)

    def handle(self, frame: bytearray, length: int) -> bool:
        """Let a frame pass; False: it does not come back."""
        datagrams = parse(frame, length)
        reads = [datagram for datagram in datagrams if datagram.command in (LRD, LRW)]
        touched = self._touched(reads) if reads else []
        self._pass_time(bool(reads), touched)
        if not self.connected or (touched and self._swallow()):
            return False
        execute(frame, datagrams, self._slaves)
        self.frames += 1
        for terminal in touched:
            terminal.count()
        return True

    def skip(self, blocks: int) -> None:
        """Let the master miss `blocks` blocks of every terminal: time jumps, or in real time the images stand still."""
        if isinstance(self.clock, VirtualClock):
            self.clock.advance(blocks * self._period())
            return
        for terminal in self.terminals:
            terminal.hold(blocks)

    def _touched(self, reads: Sequence[Datagram]) -> list[PowerTerminal]:
        """Present terminals whose first input byte a datagram reads."""
        return [
            terminal
            for terminal in self._readable()
            if any(read.logical <= (terminal.input_start or 0) < read.logical + read.size for read in reads)
        ]

    def _readable(self) -> list[PowerTerminal]:
        return [terminal for terminal in self.terminals[: self._present] if terminal.input_start is not None]

    def _pass_time(self, reads: bool, touched: Sequence[PowerTerminal]) -> None:
        """Let virtual time pass and show the newest blocks.

        A cycle takes time once, even where the process image takes several frames: that of the first terminal counts.
        It takes time, too, while no terminal is there to answer.
        """
        readable = self._readable()
        leads = reads and (touched[:1] == readable[:1])
        if touched and self.repeats:
            self.repeats -= leads
            return
        if isinstance(self.clock, VirtualClock):
            self.clock.advance(self._duration(self.clock, leads))
        for terminal in touched:
            terminal.refresh()

    def _duration(self, clock: VirtualClock, leads: bool) -> int:
        if leads:
            return self._advance or self._period()
        waiting = all(terminal.clock.waiting() for terminal in self.terminals[: self._present])
        return IDLE_NS if waiting else 0

    def _period(self) -> int:
        running = (terminal for terminal in self.terminals if terminal.clock.start is not None)
        return next(running, self.terminals[0]).period

    def _swallow(self) -> bool:
        swallowed = self.drops > 0
        self.drops -= swallowed
        return swallowed
