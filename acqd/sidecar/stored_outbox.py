"""The connector's outbox on top of the store: a committed log is published even if the process was killed."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import orjson
import sqlalchemy as sa

from acqd.sidecar.store import Store
from acqd.telemetry.message import Line, Message, Room

_POLL_S = 1.0
_AT_ONCE = 32  # logs asked for at once


class StoredOutbox:
    """Messages of logs that no broker has acknowledged."""

    def __init__(self, store: Store, topic: str, alarm_topic: str) -> None:
        self._store, self._topic, self._alarm_topic = store, topic, alarm_topic
        self._arrived = asyncio.Event()
        self._sent: set[str] = set()

    def wake(self) -> None:
        """Ends `wait` after a commit."""
        self._arrived.set()

    def subscriptions(self) -> list[str]:
        """No topics: it only publishes."""
        return []

    def begin(self) -> None:
        """A new connection: what was not acknowledged is sent again."""
        self._sent.clear()
        self._arrived.set()

    def ready(self, line: Line) -> None:
        """Nothing is urgent here."""

    def end(self) -> None:
        """The connection has ended."""
        self._sent.clear()

    async def take(self, room: Room) -> list[Message]:
        """Messages of the oldest unpublished logs that are not under way."""
        self._arrived.clear()
        most = min(_AT_ONCE, room.messages // 2)
        try:
            rows = await asyncio.to_thread(self._store.unpublished, most + len(self._sent))
        except sa.exc.DBAPIError:  # a lasting failure is reported where logs are stored
            return []
        messages = []
        for sha256, content in [row for row in rows if row[0] not in self._sent][:most]:
            messages += self._messages(sha256, content)
            self._sent.add(sha256)
        return messages

    async def wait(self) -> None:
        """Returns after a commit, or to look again."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_POLL_S):
                await self._arrived.wait()

    def acknowledged(self, message: Message) -> None:
        """Marks the log of the message as published."""
        if message.tag is not None:
            with contextlib.suppress(sa.exc.DBAPIError):  # it is published once more then
                self._store.published([message.tag])
            self._sent.discard(message.tag)

    def received(self, topic: str, payload: bytes, *, retained: bool) -> None:
        """Nothing is subscribed to."""

    def _messages(self, sha256: str, content: dict[str, Any]) -> list[Message]:
        """The alarm first: with the acknowledgement of the last message, the log is published."""
        alarm = content.get("alarm")
        messages = [Message(self._alarm_topic, orjson.dumps(alarm), retain=True)] if alarm else []
        return [*messages, Message(self._topic, orjson.dumps(content), tag=sha256)]

    def __len__(self) -> int:
        try:
            return len(self._store.unpublished(1000))
        except sa.exc.DBAPIError:
            return 1  # unknown
