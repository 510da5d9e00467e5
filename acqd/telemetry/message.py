"""Messages on their way to the broker, and the seam between what makes them and the connector that delivers them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol


@dataclass(frozen=True, slots=True)
class Message:
    """One PUBLISH with QoS 1."""

    topic: str
    payload: bytes
    retain: bool = False
    tag: Any = None
    """What the outbox wants to know again when the broker has acknowledged the message."""


@dataclass(frozen=True, slots=True)
class Room:
    """What the connection takes at the moment."""

    messages: int
    """Messages in all."""
    backlog: int
    """Of these, messages that are not urgent: a part of the window stays free for new rows."""


class Line(Protocol):
    """A connection that is ready for messages."""

    def room(self) -> Room:
        """How many messages it takes now."""

    def send(self, messages: Sequence[Message]) -> None:
        """Publish at once; what a broken connection loses is sent again after `begin`."""


class Outbox(Protocol):
    """What the connector needs of a store of messages."""

    def subscriptions(self) -> list[str]:
        """Topics whose messages `received` wants."""

    def begin(self) -> None:
        """A new connection: what was not acknowledged is to be sent again."""

    def ready(self, line: Line) -> None:
        """The connection is subscribed; until `end`, what is urgent may go straight to `line` instead of by `take`."""

    def end(self) -> None:
        """The connection has ended."""

    async def take(self, room: Room) -> list[Message]:
        """Messages to send now, each one once per connection; empty when nothing waits."""

    async def wait(self) -> None:
        """Return when `take` may have messages, after a second at the latest."""

    def acknowledged(self, message: Message) -> None:
        """The broker has this message."""

    def received(self, topic: str, payload: bytes, *, retained: bool) -> None:
        """A message of a subscription; `retained`: the broker had kept it from before."""

    def __len__(self) -> int:
        """Messages waiting."""
