"""Messages on their way to the broker: the seam between rows being made and rows being delivered."""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Message:
    """One PUBLISH with QoS 1."""

    topic: str
    payload: bytes
    retain: bool = False


class Outbox(Protocol):
    """What the connector needs; an on-disk spool can stand in for the memory queue."""

    dropped: int
    """Messages dropped because the outbox was full."""

    def put(self, message: Message) -> None:
        """Accept a message; never blocks."""

    async def peek(self, most: int) -> list[Message]:
        """The oldest messages, at least one: waits for it. They stay until confirmed."""

    def confirm(self, messages: list[Message]) -> None:
        """The broker has these messages (the ones `peek` gave): forget them."""

    def __len__(self) -> int:
        """Messages waiting."""


class MemoryOutbox:
    """Bounded queue in memory; when full, the oldest message is dropped and counted."""

    def __init__(self, capacity: int) -> None:
        self._messages: deque[Message] = deque()
        self._capacity = capacity
        self._arrived = asyncio.Event()
        self.dropped = 0

    def put(self, message: Message) -> None:
        """Accept a message, at the cost of the oldest one when full."""
        if len(self._messages) >= self._capacity:
            self._messages.popleft()
            self.dropped += 1
        self._messages.append(message)
        self._arrived.set()

    async def peek(self, most: int) -> list[Message]:
        """The oldest messages, waiting for the first."""
        while not self._messages:
            self._arrived.clear()
            await self._arrived.wait()
        return [self._messages[k] for k in range(min(most, len(self._messages)))]

    def confirm(self, messages: list[Message]) -> None:
        """Forget delivered messages; those dropped meanwhile are gone already."""
        for message in messages:
            if self._messages and self._messages[0] is message:
                self._messages.popleft()

    def __len__(self) -> int:
        return len(self._messages)
