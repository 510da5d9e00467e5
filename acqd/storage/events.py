"""Voltage events into the table `power_event`: the message at an event's end replaces the message at its start."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any, Protocol

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.database import transaction
from acqd.storage.schema import power_event
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent, parse_event
from acqd.timestamps import filetime

_AHEAD_NS = 86_400 * 10**9
_KEY = ("device", "boot", "number")


class Message(Protocol):
    """As it came from the broker."""

    @property
    def topic(self) -> str:
        """Where to."""

    @property
    def payload(self) -> bytes:
        """What."""


def store(engine: sa.Engine, messages: Sequence[Message]) -> list[tuple[int, str]]:
    """Commit the events in `messages`; positions of the other messages, with the reasons.

    Raises sqlalchemy.exc.DBAPIError while the database cannot.
    """
    events: list[PowerEvent] = []
    refused: list[tuple[int, str]] = []
    for k, message in enumerate(messages):
        try:
            events.append(_checked(message))
        except ValueError as error:
            refused.append((k, str(error)))
    if events:
        with transaction(engine) as connection:
            _insert(connection, events)
    return refused


def _insert(connection: sa.Connection, events: Sequence[PowerEvent]) -> None:
    """An event that is stored with its end stays as it is."""
    postgres = connection.dialect.name == "postgresql"
    statement: Any = (postgresql.insert if postgres else sqlite.insert)(power_event)
    changed = {c.name: statement.excluded[c.name] for c in power_event.columns if c.name not in _KEY}
    statement = statement.on_conflict_do_update(
        index_elements=list(_KEY), set_=changed, where=power_event.c.duration.is_(None)
    )
    connection.execute(statement, [_values(event, postgres) for event in events])


def _values(event: PowerEvent, postgres: bool) -> dict[str, Any]:
    values = asdict(event)
    return values | {"time": datetime.fromisoformat(event.time)} if postgres else values


def _checked(message: Message) -> PowerEvent:
    event = parse_event(message.payload)
    expected = topics.event(event.device)
    if message.topic != expected:
        raise ValueError(f"payload is of {expected}, but came by another topic")
    if not filetime(0) <= event.filetime <= filetime(time.time_ns() + _AHEAD_NS):
        raise ValueError(f"time {event.time} is before 1970, or more than a day ahead of this computer's clock")
    return event
