"""Takes acqd's entities out of Home Assistant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import orjson

from acqd.integrations.homeassistant.entities import OURS
from acqd.telemetry.message import Message


@dataclass(slots=True)
class Removal:
    """Deletes the configurations that Discovery has left with the broker, by empty retained messages."""

    prefix: str = "homeassistant"
    device: str | None = None
    """Only this device; None: all."""
    removed: int = 0

    def subscriptions(self) -> Sequence[str]:
        """Retained configurations."""
        return tuple(f"{self.prefix}/{kind}/+/+/config" for kind in ("sensor", "event"))

    def will(self) -> None:
        """None."""

    def begin(self) -> Iterable[Message]:
        """Nothing to send."""
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A configuration; those of other programs stay."""
        try:
            found = orjson.loads(payload)
            ours = found["origin"]["name"] == OURS and found["device"]["manufacturer"] == OURS
            name = found["device"]["name"]
        except (orjson.JSONDecodeError, KeyError, TypeError):
            return ()
        if not ours or self.device not in (None, name):
            return ()
        self.removed += 1
        return [Message(topic, b"", retain=True)]

    def tick(self) -> Iterable[Message]:
        """Nothing is due."""
        return ()
