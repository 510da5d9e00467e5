"""The connector's outbox on top of the store: a committed log is published even if the process was killed."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import orjson
import sqlalchemy as sa

from acqd.sidecar.store import Store
from acqd.telemetry.outbox import Message

_POLL_S = 1.0


class StoredOutbox:
    """Messages of logs that no broker has acknowledged."""

    dropped = 0

    def __init__(self, store: Store, topic: str, alarm_topic: str) -> None:
        self._store, self._topic, self._alarm_topic = store, topic, alarm_topic
        self._arrived = asyncio.Event()
        self._hashes: dict[int, str] = {}

    def put(self, message: Message) -> None:  # noqa: ARG002
        """Wakes `peek` only: messages come from the store."""
        self._arrived.set()

    def wake(self) -> None:
        """Wakes `peek` after a commit."""
        self._arrived.set()

    async def peek(self, most: int) -> list[Message]:
        """Messages of the oldest unpublished logs; waits for the first."""
        while True:
            self._arrived.clear()
            try:
                rows = await asyncio.to_thread(self._store.unpublished, max(1, most // 2))
            except sa.exc.DatabaseError:  # a lasting failure is reported where logs are stored
                await asyncio.sleep(_POLL_S)
                continue
            if rows:
                return self._messages(rows)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._arrived.wait(), _POLL_S)

    def _messages(self, rows: list[tuple[str, dict[str, Any]]]) -> list[Message]:
        messages = []
        self._hashes = {}
        for sha256, content in rows:
            if content.get("alarm"):
                messages.append(Message(self._alarm_topic, orjson.dumps(content["alarm"]), retain=True))
            messages.append(Message(self._topic, orjson.dumps(content)))
            self._hashes[id(messages[-1])] = sha256
        return messages

    def confirm(self, messages: list[Message]) -> None:
        """Marks the logs of these messages as published."""
        with contextlib.suppress(sa.exc.DatabaseError):  # they are published once more then
            self._store.published([self._hashes[id(message)] for message in messages if id(message) in self._hashes])

    def __len__(self) -> int:
        try:
            return len(self._store.unpublished(1000))
        except sa.exc.DatabaseError:
            return 1  # unknown
