"""The sliding window of a connection: messages that are sent and not acknowledged."""

from __future__ import annotations

import time

from acqd.telemetry.message import Message, Room

_AT_ONCE = 64
"""Messages handed over in one turn of the event loop."""
_MOST, _MOST_BYTES = 1_024, 512 << 10
"""Unacknowledged messages and their payloads at most."""
_BACKLOG, _BACKLOG_BYTES = 512, 160 << 10
"""The share of it that the backlog may fill: at 1 Mbit/s, a new row waits for a second behind it."""


class Window:
    """Messages by packet number."""

    def __init__(self) -> None:
        self._messages: dict[int, tuple[Message, float]] = {}  # and when it was sent
        self._bytes = 0
        self._progress = time.monotonic()
        self.acknowledged = 0
        """Messages that were acknowledged."""
        self.took_s = 0.0
        """How long the acknowledgement of the last of them took."""

    def add(self, number: int, message: Message) -> None:
        """The message is sent."""
        now = time.monotonic()
        if not self._messages:
            self._progress = now
        self._messages[number] = message, now
        self._bytes += len(message.payload)

    def settle(self, number: int) -> Message | None:
        """The acknowledged message; None for a number that is not known."""
        message, sent = self._messages.pop(number, (None, 0.0))
        if message is not None:
            self._bytes -= len(message.payload)
            self._progress = time.monotonic()
            self.took_s = self._progress - sent
            self.acknowledged += 1
        return message

    def room(self) -> Room:
        """How many messages may be sent now."""
        if self._bytes >= _MOST_BYTES:
            return Room(0, 0)
        backlog = 0 if self._bytes >= _BACKLOG_BYTES else _BACKLOG - len(self._messages)
        return Room(min(_AT_ONCE, _MOST - len(self._messages)), min(_AT_ONCE, backlog))

    def silent_s(self) -> float:
        """How long nothing has been acknowledged although something is to be [s]."""
        return time.monotonic() - self._progress if self._messages else 0.0

    def __len__(self) -> int:
        return len(self._messages)

    def __contains__(self, number: int) -> bool:
        return number in self._messages
