"""What the sidecar has done, in SQL: a log, its predictions and all memory in one transaction.

So nothing is done twice, whenever the process ends.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
import orjson
import sqlalchemy as sa

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.storage.database import transaction
from acqd.storage.schema import prediction, prediction_log, sidecar_state
from acqd.telemetry.outbox import Message

_POLL_S = 1.0
_LOCK = 4607182418800017409


@dataclass(slots=True)
class Done:
    """A log that was worked through."""

    sha256: str
    name: str
    model: str
    status: str
    message: dict[str, Any]
    """What is published of it."""
    filetime: np.ndarray[Any, np.dtype[np.int64]] = field(default_factory=lambda: np.empty(0, np.int64))
    """[T]."""
    P: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W, measured."""
    P_predicted: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W."""


class Store:
    """One database."""

    def __init__(self, engine: sa.Engine) -> None:
        self.engine = engine

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """While no other sidecar works on this database: what it remembers is one. Raises UserError."""
        with contextlib.ExitStack() as stack:
            if not self._claimed(stack):
                raise UserError("another sidecar works on this database; stop it, or give this one its own --database")
            yield

    def _claimed(self, stack: contextlib.ExitStack) -> bool:
        """Until the stack is left, or the process dies."""
        if self.engine.dialect.name == "postgresql":
            engine = self.engine.execution_options(isolation_level="AUTOCOMMIT")
            connection = stack.enter_context(engine.connect())
            connection.detach()  # the lock ends with the connection, which must not go back to the pool
            return bool(connection.execute(sa.select(sa.func.pg_try_advisory_lock(_LOCK))).scalar())
        path = self.engine.url.database
        if not path or path == ":memory:":
            return True
        file = os.open(f"{path}.sidecar-lock", os.O_CREAT | os.O_RDWR, 0o644)
        stack.callback(os.close, file)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def status(self, sha256: str) -> str | None:
        """Of the log with this content: "ok", "refused", "superseded"; None when it is new."""
        with self.engine.connect() as connection:
            query = sa.select(prediction_log.c.status).where(prediction_log.c.sha256 == sha256)
            row = connection.execute(query).first()
        return None if row is None else str(row[0])

    def memory(self, key: str) -> Any:
        """What was remembered under a key, or None."""
        with self.engine.connect() as connection:
            row = connection.execute(sa.select(sidecar_state.c.value).where(sidecar_state.c.key == key)).first()
        return None if row is None else row[0]

    def commit(
        self, done: Done, memory: dict[str, Any], elsewhere: Callable[[str], str | None] = lambda _: None
    ) -> None:
        """All of it or nothing. A log that had the same name before is superseded: its rows go.

        Unless a file of another name holds its content (logs are rotated, copied): `elsewhere` says which.
        """
        now = datetime.now(UTC)
        stamp: Any = now if self.engine.dialect.name == "postgresql" else now.isoformat(timespec="milliseconds")
        rows = zip(done.filetime.tolist(), done.P.tolist(), done.P_predicted.tolist(), strict=True)
        with transaction(self.engine) as connection:
            earlier = connection.execute(
                sa.select(prediction_log.c.sha256).where(
                    prediction_log.c.name == done.name, prediction_log.c.status != "superseded"
                )
            ).scalars()
            for old in list(earlier):
                entry = sa.update(prediction_log).where(prediction_log.c.sha256 == old)
                if (name := elsewhere(old)) is not None:
                    connection.execute(entry.values(name=name))
                    continue
                connection.execute(sa.delete(prediction).where(prediction.c.sha256 == old))
                connection.execute(entry.values(status="superseded"))
            for table in (prediction, prediction_log):  # superseded or refused once, and looked at again
                connection.execute(sa.delete(table).where(table.c.sha256 == done.sha256))
            connection.execute(
                sa.insert(prediction_log).values(
                    sha256=done.sha256, name=done.name, model=done.model, status=done.status, message=done.message,
                    published=False, done=stamp,
                )
            )  # fmt: skip
            values = [
                {"sha256": done.sha256, "filetime": t, "P": P, "P_predicted": guess, "residual": P - guess}
                for t, P, guess in rows
            ]
            if values:
                connection.execute(sa.insert(prediction), values)
            for key, value in memory.items():
                connection.execute(sa.delete(sidecar_state).where(sidecar_state.c.key == key))
                connection.execute(sa.insert(sidecar_state).values(key=key, value=value))

    def unpublished(self, most: int) -> list[tuple[str, dict[str, Any]]]:
        """Hash and message of logs that no broker has acknowledged yet, the oldest first."""
        query = sa.select(prediction_log.c.sha256, prediction_log.c.message).where(~prediction_log.c.published)
        with self.engine.connect() as connection:
            rows = connection.execute(query.order_by(prediction_log.c.done).limit(most)).all()
        return [(row[0], row[1]) for row in rows]

    def published(self, hashes: Sequence[str]) -> None:
        """A broker has them."""
        with transaction(self.engine) as connection:
            connection.execute(
                sa.update(prediction_log).where(prediction_log.c.sha256.in_(hashes)).values(published=True)
            )


class StoredOutbox:
    """Outbox of the connector on top of the table: what is committed is published, whoever was killed in between."""

    dropped = 0

    def __init__(self, store: Store, topic: str, alarm_topic: str) -> None:
        self._store, self._topic, self._alarm_topic = store, topic, alarm_topic
        self._arrived = asyncio.Event()
        self._hashes: dict[int, str] = {}

    def put(self, message: Message) -> None:  # noqa: ARG002
        """Messages come from the table only: this wakes whoever waits for them."""
        self._arrived.set()

    def wake(self) -> None:
        """Something was committed."""
        self._arrived.set()

    async def peek(self, most: int) -> list[Message]:
        """See Outbox."""
        while True:
            self._arrived.clear()
            try:
                rows = await asyncio.to_thread(self._store.unpublished, max(1, most // 2))
            except sa.exc.DatabaseError:  # it comes back, or the work says so
                await asyncio.sleep(_POLL_S)
                continue
            if rows:
                return self._messages(rows)
            try:
                await asyncio.wait_for(self._arrived.wait(), _POLL_S)
            except TimeoutError:
                continue

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
        """See Outbox."""
        with contextlib.suppress(sa.exc.DatabaseError):  # then they are published once more
            self._store.published([self._hashes[id(each)] for each in messages if id(each) in self._hashes])

    def __len__(self) -> int:
        try:
            return len(self._store.unpublished(1000))
        except sa.exc.DatabaseError:
            return 1  # unknown
