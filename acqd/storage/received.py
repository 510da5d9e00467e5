"""Messages as they come from the broker, and the rows in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, TypeAlias

from acqd.storage import events
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow, parse_quality
from acqd.telemetry.register_row import RegisterRow, parse_registers
from acqd.telemetry.row import PowerRow, parse_each, parse_row
from acqd.telemetry.row_message import payloads_of
from acqd.telemetry.spool import Stream

Row: TypeAlias = PowerRow | QualityRow | RegisterRow


class Message(events.Message, Protocol):
    """As it came from the broker."""

    @property
    def oversized(self) -> int:
        """Bytes of a message that is longer than the limit, its payload is cut; else 0."""


class Received(NamedTuple):
    """A message from elsewhere than the connection to a broker."""

    topic: str
    payload: bytes
    oversized: int = 0


Refused: TypeAlias = tuple[Message, str]
"""A message that is no new row, and the reason."""


@dataclass(slots=True)
class Sorted:
    """Messages by what they hold."""

    rows: list[Row] = field(default_factory=list)
    origins: list[Message] = field(default_factory=list)
    """The message of each row. Two lists, for there are many: pairs would cost more than all checks of a row."""
    refused: list[Refused] = field(default_factory=list)
    events: list[Message] = field(default_factory=list)
    asks: list[Message] = field(default_factory=list)

    def add(self, origin: Message, row: Row) -> None:
        """One row."""
        self.rows.append(row)
        self.origins.append(origin)


def sort(messages: Sequence[Message]) -> Sorted:
    """Read the rows; events and questions are set apart as they came."""
    found = Sorted()
    places = {topic: topics.place(topic) for topic in {message.topic for message in messages}}
    power = [message for message in messages if places[message.topic].kind == "power" and not message.oversized]
    for message in messages if len(power) < len(messages) else ():
        place = places[message.topic]
        if place.kind == "power" and not message.oversized:
            continue
        try:
            if place.kind == "event":
                found.events.append(message)
            elif place.kind == "ask":
                found.asks.append(message)
            elif place.kind == "window" and not message.oversized:
                _sort_window(message, place, found)
            else:
                found.add(message, _row(message, place))
        except ValueError as error:
            found.refused.append((message, str(error)))
    rows, origins = found.rows, found.origins
    for message, row in zip(power, parse_each([message.payload for message in power]), strict=True):
        place = places[message.topic]
        if isinstance(row, ValueError):
            found.refused.append((message, str(row)))
        elif row.device == place.device and row.channel == place.channel:
            rows.append(row)
            origins.append(message)
        else:
            found.refused.append((message, _elsewhere(row)))
    return found


def message_row(message: Message) -> Row | PowerEvent:
    """The row or event in a message of one, whatever its time. Raises ValueError."""
    place = topics.place(message.topic)
    return events.parsed_event(message) if place.kind == "event" else _row(message, place)


def by_stream(rows: Iterable[Row]) -> dict[Stream, Sequence[Row]]:
    """The rows of each stream, in their order."""
    found: dict[tuple[type[Row], str, str, str], list[Row]] = {}
    for row in rows:
        key = row.__class__, row.device, row.channel, row.boot
        if key in found:
            found[key].append(row)
        else:
            found[key] = [row]
    return {Stream(device, _stream_channel(kind, name), boot): of for (kind, device, name, boot), of in found.items()}


def _sort_window(message: Message, place: topics.Place, found: Sorted) -> None:
    """Raises ValueError for a window that is no list; what is wrong in it alone is refused alone."""
    for payload in payloads_of(message.topic, message.payload):
        part = Received(message.topic, payload)
        try:
            found.add(part, _row(part, place))
        except ValueError as error:
            found.refused.append((part, str(error)))


def _row(message: Message, place: topics.Place) -> Row:
    if message.oversized:
        raise ValueError(f"message of {message.oversized} bytes is too large for a row")
    kind = place.kind
    if kind == "quality":
        row: Row = parse_quality(message.payload)
    else:
        row = parse_registers(message.payload) if kind == "registers" else parse_row(message.payload)
    if row.device != place.device or (row.channel != place.channel and kind != "window"):
        raise ValueError(_elsewhere(row))
    return row


def _elsewhere(row: Row) -> str:
    expected = topics.row(row.device, _stream_channel(row.__class__, row.channel))
    return f"payload is of {expected}, but came by another topic"


def _stream_channel(kind: type[Row], channel: str) -> str:
    """What names the stream of a row in receipts, in the place of a channel."""
    if kind is QualityRow:
        return topics.quality_stream(channel)
    return topics.register_stream(channel) if kind is RegisterRow else channel
