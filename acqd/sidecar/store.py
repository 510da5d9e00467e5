"""The sidecar's tables: a log, its predictions and the whole memory are written in one transaction.

So no log is done twice, at whatever moment the process ends.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np
import sqlalchemy as sa

from acqd.arrays import Floats
from acqd.storage.database import transaction
from acqd.storage.schema import prediction, prediction_log, sidecar_state
from acqd.timestamps import rfc3339, utc_ns

_ROWS_AT_ONCE = 5000  # of one statement: a log of hours has many


@dataclass(slots=True)
class Done:
    """A log that was worked through."""

    sha256: str
    name: str
    model: str
    status: str
    message: dict[str, Any]
    """What is published of the log."""
    filetime: np.ndarray[Any, np.dtype[np.int64]] = field(default_factory=lambda: np.empty(0, np.int64))
    """[T]."""
    P: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W, measured."""
    P_predicted: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W."""


class Store:
    """Logs, predictions and memory in one database."""

    def __init__(self, engine: sa.Engine, device: str | None = None) -> None:
        """`device`: whose power is predicted, for the rows."""
        self.engine, self._device = engine, device

    def status(self, sha256: str) -> str | None:
        """Status of the log with this content: "ok", "refused", "superseded"; None if the log is new."""
        with self.engine.connect() as connection:
            query = sa.select(prediction_log.c.status).where(prediction_log.c.sha256 == sha256)
            row = connection.execute(query).first()
        return None if row is None else str(row[0])

    def memory(self, key: str) -> Any:
        """The value that was stored under a key, or None."""
        with self.engine.connect() as connection:
            row = connection.execute(sa.select(sidecar_state.c.value).where(sidecar_state.c.key == key)).first()
        return None if row is None else row[0]

    def commit(
        self, done: Done, memory: dict[str, Any], elsewhere: Callable[[str], str | None] = lambda _: None
    ) -> None:
        """Writes everything or nothing. An earlier log of the same name is superseded, and its rows are deleted.

        `elsewhere` gives the name of another file that holds the earlier log's content, because logs are rotated and
        copied; the earlier log then takes that name and keeps its rows.
        """
        with transaction(self.engine) as connection:
            _supersede(connection, done.name, elsewhere)
            _insert(connection, done, self._device)
            for key, value in memory.items():
                connection.execute(sa.delete(sidecar_state).where(sidecar_state.c.key == key))
                connection.execute(sa.insert(sidecar_state).values(key=key, value=value))

    def unpublished(self, most: int) -> list[tuple[str, dict[str, Any]]]:
        """Hash and message of logs that no broker has acknowledged yet, oldest first."""
        query = sa.select(prediction_log.c.sha256, prediction_log.c.message).where(~prediction_log.c.published)
        with self.engine.connect() as connection:
            rows = connection.execute(query.order_by(prediction_log.c.done).limit(most)).all()
        return [(row[0], row[1]) for row in rows]

    def published(self, hashes: Sequence[str]) -> None:
        """Marks logs whose messages a broker has acknowledged."""
        with transaction(self.engine) as connection:
            connection.execute(
                sa.update(prediction_log).where(prediction_log.c.sha256.in_(hashes)).values(published=True)
            )


def _supersede(connection: sa.Connection, name: str, elsewhere: Callable[[str], str | None]) -> None:
    earlier = connection.execute(
        sa.select(prediction_log.c.sha256).where(prediction_log.c.name == name, prediction_log.c.status != "superseded")
    ).scalars()
    for sha256 in list(earlier):
        entry = sa.update(prediction_log).where(prediction_log.c.sha256 == sha256)
        if (other := elsewhere(sha256)) is not None:
            connection.execute(entry.values(name=other))
            continue
        connection.execute(sa.delete(prediction).where(prediction.c.sha256 == sha256))
        connection.execute(entry.values(status="superseded"))


def _insert(connection: sa.Connection, done: Done, device: str | None) -> None:
    for table in (prediction, prediction_log):  # the same content may have been superseded or refused before
        connection.execute(sa.delete(table).where(table.c.sha256 == done.sha256))
    connection.execute(
        sa.insert(prediction_log).values(
            sha256=done.sha256, name=done.name, model=done.model, status=done.status, message=done.message,
            published=False, done=_stamp(connection, time.time_ns(), 3),
        )
    )  # fmt: skip
    for first in range(0, len(done.filetime), _ROWS_AT_ONCE):
        part = slice(first, first + _ROWS_AT_ONCE)
        rows = zip(done.filetime[part].tolist(), done.P[part].tolist(), done.P_predicted[part].tolist(), strict=True)
        values = [
            {"sha256": done.sha256, "filetime": t, "P": P, "P_predicted": predicted, "residual": P - predicted,
             "device": device, "time": _stamp(connection, utc_ns(t))}
            for t, P, predicted in rows
        ]  # fmt: skip
        connection.execute(sa.insert(prediction), values)


def _stamp(connection: sa.Connection, ns: int, digits: int = 6) -> Any:
    """A time as the database wants it: PostgreSQL takes timestamptz, SQLite RFC 3339."""
    text = rfc3339(ns, digits)
    return datetime.fromisoformat(text) if connection.dialect.name == "postgresql" else text
