"""Messages that are no new rows, with the reason; the same message for the same reason is kept once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, Protocol

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.away import left_out
from acqd.storage.schema import quarantine
from acqd.timestamps import rfc3339

PAYLOAD_KEPT = 65_536
"""Bytes of a payload that are worth keeping."""
_AT_ONCE = 500
"""Hashes of one query."""


class _Message(Protocol):
    @property
    def topic(self) -> str: ...

    @property
    def payload(self) -> bytes: ...


def insert(connection: sa.Connection, messages: Sequence[tuple[_Message, str]]) -> list[int]:
    """Keep messages with their reasons, in the transaction of `connection`; bytes of the payloads of new ones.

    Raises the errors of SQLAlchemy; DatabaseAwayError where the database drops messages without an error.
    """
    postgres = connection.dialect.name == "postgresql"
    now = datetime.now(UTC)
    received: Any = now if postgres else rfc3339(int(now.timestamp() * 1e9))
    entries = {
        (digest := _hash(message, reason)): {
            "received": received,
            "topic": message.topic.replace("\0", "?"),
            "payload": message.payload[:PAYLOAD_KEPT],
            "reason": reason.replace("\0", "?"),
            "sha256": digest,
        }
        for message, reason in messages
    }
    known = _known(connection, list(entries))
    new = [entry for digest, entry in entries.items() if digest not in known]
    if not new:
        return []
    statement: Any = (postgresql.insert if postgres else sqlite.insert)(quarantine)
    connection.execute(statement.on_conflict_do_nothing(index_elements=["sha256"]), new)
    if missing := len(entries) - len(_known(connection, list(entries))):
        raise left_out(connection, missing)
    return [len(entry["payload"]) for entry in new]


def _known(connection: sa.Connection, digests: Sequence[str]) -> set[str]:
    """Which of them are kept."""
    found: set[str] = set()
    for begin in range(0, len(digests), _AT_ONCE):
        some = digests[begin : begin + _AT_ONCE]
        found |= set(connection.execute(sa.select(quarantine.c.sha256).where(quarantine.c.sha256.in_(some))).scalars())
    return found


def _hash(message: _Message, reason: str) -> str:
    digest = hashlib.sha256()
    for part in (message.topic.encode(), message.payload, reason.encode()):
        digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()
