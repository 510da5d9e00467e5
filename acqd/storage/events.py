"""Voltage events into the table `power_event`: the message at an event's end replaces the message at its start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import datetime
from typing import Any, Protocol, TypeVar

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from acqd.storage.away import left_out
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


_Message = TypeVar("_Message", bound=Message)


def judged(
    messages: Sequence[_Message], witness: ClockWitness
) -> tuple[list[tuple[_Message, PowerEvent]], list[tuple[_Message, str]]]:
    """The events in messages, flagged where their time is in doubt; the other messages, with the reasons."""
    found: list[tuple[_Message, PowerEvent]] = []
    refused: list[tuple[_Message, str]] = []
    for message in messages:
        try:
            found.append((message, _checked(message, witness)))
        except ValueError as error:
            refused.append((message, str(error)))
    return found, refused


def insert(connection: sa.Connection, events: Sequence[PowerEvent]) -> list[PowerEvent]:
    """An event that is stored with its end stays as it is; those that end otherwise.

    Raises the errors of SQLAlchemy; DatabaseAwayError where the database drops events without an error.
    """
    postgres = connection.dialect.name == "postgresql"
    last: dict[tuple[Any, ...], PowerEvent] = {}
    for event in events:
        if (before := last.get(_key(event))) is None or before.duration is None:
            last[_key(event)] = event
    known = {key for key in last if _stored(connection, key) is not None}
    if new := [_values(event, postgres) for key, event in last.items() if key not in known]:
        connection.execute(_upsert(postgres), new)
    for key in known:  # an UPDATE reaches an event that a trigger has put into a part of the table
        running = sa.update(power_event).where(*_is(key), power_event.c.duration.is_(None))
        connection.execute(running, _values(last[key], postgres))
    stored = {key: _stored(connection, key) for key in last}
    if missing := sum(not _holds(stored[key], event) for key, event in last.items()):
        raise left_out(connection, missing)
    ended = [event for event in events if event.duration is not None]
    return [event for event in ended if not same_row(stored[_key(event)] or {}, _values(event, postgres))]


def _upsert(postgres: bool) -> Any:
    """Another sink may be about to store the same event."""
    statement: Any = (postgresql.insert if postgres else sqlite.insert)(power_event)
    changed = {c.name: statement.excluded[c.name] for c in power_event.columns if c.name not in _KEY}
    running = power_event.c.duration.is_(None)
    return statement.on_conflict_do_update(index_elements=list(_KEY), set_=changed, where=running)


def _key(event: PowerEvent) -> tuple[Any, ...]:
    return tuple(getattr(event, name) for name in _KEY)


def _is(key: tuple[Any, ...]) -> list[sa.ColumnElement[bool]]:
    return [power_event.c[name] == value for name, value in zip(_KEY, key, strict=True)]


def _stored(connection: sa.Connection, key: tuple[Any, ...]) -> dict[str, Any] | None:
    found = connection.execute(sa.select(power_event).where(*_is(key))).mappings().first()
    return None if found is None else dict(found)


def _holds(stored: dict[str, Any] | None, event: PowerEvent) -> bool:
    """Whether an event is there, and with an end if it has one."""
    return stored is not None and (event.duration is None or stored["duration"] is not None)


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
