"""Messages that are neither rows nor states: few, each one to be delivered to the broker once, with QoS 1."""

from __future__ import annotations

import logging
from collections import deque

from acqd.telemetry.message import Message

_log = logging.getLogger(__name__)
_MOST = 1_000
"""Messages that wait for a broker; the oldest ones are dropped."""


class Notices:
    """Kept in memory until the broker has acknowledged them."""

    def __init__(self) -> None:
        self._waiting: dict[int, Message] = {}
        self._unsent: deque[int] = deque()
        self._number = 0
        self.dropped = 0
        """Messages given up because too many waited."""

    def put(self, topic: str, payload: bytes) -> None:
        """Have a message sent."""
        self._number += 1
        self._waiting[self._number] = Message(topic, payload, tag=self._number)
        self._unsent.append(self._number)
        if len(self._waiting) > _MOST:
            self._waiting.pop(next(iter(self._waiting)))
            if not self.dropped:
                _log.error("%d events wait for the broker: the oldest ones are dropped", _MOST)
            self.dropped += 1

    def begin(self) -> None:
        """A new connection: what was not acknowledged is to be sent again."""
        self._unsent = deque(self._waiting)

    def take(self, most: int) -> list[Message]:
        """Messages to send now."""
        numbers = [self._unsent.popleft() for _ in range(min(most, len(self._unsent)))]
        return [self._waiting[number] for number in numbers if number in self._waiting]

    def acknowledged(self, message: Message) -> bool:
        """Whether this was one of ours; the broker has it."""
        return isinstance(message.tag, int) and self._waiting.pop(message.tag, message) is not None

    def __len__(self) -> int:
        return len(self._waiting)
