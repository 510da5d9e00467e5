"""Voltage events into the table `power_event`: the message at an event's end replaces the message at its start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from typing import Any, Protocol

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.clock_witness import FLAG, ClockWitness
from acqd.storage.schema import power_event
from acqd.storage.sink_flags import same_row
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent, parse_event

_KEY = ("device", "boot", "number")
CONFLICT = "another event with this key is stored"


class Message(Protocol):
    """As it came from the broker."""

    @property
    def topic(self) -> str:
        """Where to."""

    @property
    def payload(self) -> bytes:
        """What."""


@dataclass(frozen=True, slots=True)
class StoredEvents:
    """What became of messages."""

    events: list[PowerEvent] = field(default_factory=list)
    """Those that are stored, or were before."""
    refused: list[tuple[int, str]] = field(default_factory=list)
    """Positions of the others, with the reasons."""


def store(
    begin: Callable[[], AbstractContextManager[sa.Connection]], messages: Sequence[Message], witness: ClockWitness
) -> StoredEvents:
    """Commit the events in `messages` in the transaction that `begin` begins.

    Raises sqlalchemy.exc.DBAPIError while the database cannot.
    """
    found: list[tuple[int, PowerEvent]] = []
    stored = StoredEvents()
    for k, message in enumerate(messages):
        try:
            found.append((k, _checked(message, witness)))
        except ValueError as error:
            stored.refused.append((k, str(error)))
    if found:
        with begin() as connection:
            differing = insert(connection, [event for _, event in found])
        for k, event in found:
            if event in differing:
                stored.refused.append((k, CONFLICT))
            else:
                stored.events.append(event)
    return stored


def insert(connection: sa.Connection, events: Sequence[PowerEvent]) -> list[PowerEvent]:
    """An event that is stored with its end stays as it is; those that end otherwise."""
    postgres = connection.dialect.name == "postgresql"
    statement: Any = (postgresql.insert if postgres else sqlite.insert)(power_event)
    changed = {c.name: statement.excluded[c.name] for c in power_event.columns if c.name not in _KEY}
    statement = statement.on_conflict_do_update(
        index_elements=list(_KEY), set_=changed, where=power_event.c.duration.is_(None)
    )
    connection.execute(statement, [_values(event, postgres) for event in events])
    return [event for event in events if event.duration is not None and not _is_stored(connection, event, postgres)]


def _is_stored(connection: sa.Connection, event: PowerEvent, postgres: bool) -> bool:
    key = [power_event.c[name] == getattr(event, name) for name in _KEY]
    stored = connection.execute(sa.select(power_event).where(*key)).mappings().one()
    return same_row(dict(stored), _values(event, postgres))


def _values(event: PowerEvent, postgres: bool) -> dict[str, Any]:
    values = asdict(event)
    del values["archive"]  # device and time say the same, for as long as the ring has the samples
    return values | {"time": datetime.fromisoformat(event.time)} if postgres else values


def parsed_event(message: Message) -> PowerEvent:
    """The event in a message. Raises ValueError."""
    event = parse_event(message.payload)
    expected = topics.event(event.device)
    if message.topic != expected:
        raise ValueError(f"payload is of {expected}, but came by another topic")
    return event


def _checked(message: Message, witness: ClockWitness) -> PowerEvent:
    event = parsed_event(message)
    if witness.judge(event.device, event.filetime, event.time, event.flags) == "doubtful":
        event = replace(event, flags=sorted({*event.flags, FLAG}))
    return event
