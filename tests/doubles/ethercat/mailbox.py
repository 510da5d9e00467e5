"""Mailbox of a slave: SyncManager 0 takes a message, SyncManager 1 hands out the answers (ETG.1000.4, 6.7)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

from .registers import SM, U16

STATUS: Final = SM + 8 + 5
ACTIVATION: Final = SM + 8 + 6
PDI_CONTROL: Final = SM + 8 + 7
FULL: Final = 0x08
REPEAT: Final = 0x02


class Mailbox:
    """Both mailbox SyncManagers over the slave's `memory`; `answer` turns a message into an answer or None."""

    def __init__(self, memory: bytearray, answer: Callable[[bytes], bytes | None]) -> None:
        self._memory = memory
        self._answer = answer
        self._waiting: deque[bytes] = deque()
        self._last = b""
        self._last_repeat = 0

    def window(self, manager: int) -> tuple[int, int]:
        """First and end address of a SyncManager's memory; (0, 0) where it is not activated."""
        base = SM + 8 * manager
        if not self._memory[base + 6] & 0x01:
            return 0, 0
        first: int = U16.unpack_from(self._memory, base)[0]
        length: int = U16.unpack_from(self._memory, base + 2)[0]
        return first, first + length

    def readable(self, address: int, end: int) -> bool:
        """Whether a read may touch [address, end): the answer's memory is closed while it is empty."""
        first, last = self.window(1)
        return not (address < last and end > first) or bool(self._memory[STATUS] & FULL)

    def was_read(self, end: int) -> None:
        """Free the mailbox where a read reached its last byte."""
        if end == self.window(1)[1] and self._memory[STATUS] & FULL:
            self._memory[STATUS] &= ~FULL
            self._load()

    def was_written(self, address: int, end: int) -> None:
        """Deliver a message where a write reached the last byte, and repeat an answer where that is asked for."""
        first, last = self.window(0)
        if last and address == first and end == last:
            reply = self._answer(bytes(self._memory[first:last]))
            if reply is not None:
                self._waiting.append(reply)
                self._load()
        if address <= ACTIVATION < end:
            self._repeat()

    def reset(self) -> None:
        """Forget every message."""
        self._waiting.clear()
        self._memory[STATUS] &= ~FULL
        self._last, self._last_repeat = b"", 0

    def _repeat(self) -> None:
        asked = self._memory[ACTIVATION] & REPEAT
        if asked == self._last_repeat:
            return
        self._last_repeat = asked
        if self._last and not self._memory[STATUS] & FULL:
            self._waiting.appendleft(self._last)
            self._load()
        self._memory[PDI_CONTROL] = (self._memory[PDI_CONTROL] & ~REPEAT) | asked

    def _load(self) -> None:
        first, last = self.window(1)
        if not self._waiting or not last or self._memory[STATUS] & FULL:
            return
        self._last = self._waiting.popleft()
        self._memory[first:last] = self._last.ljust(last - first, b"\0")[: last - first]
        self._memory[STATUS] |= FULL
