"""Messages as they come from the broker, and the rows in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from acqd.storage import events
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow, parse_quality
from acqd.telemetry.register_row import RegisterRow, parse_registers
from acqd.telemetry.row import PowerRow, parse_each, parse_row
from acqd.telemetry.row_message import payloads_of
from acqd.telemetry.spool import Stream

Row: TypeAlias = PowerRow | QualityRow | RegisterRow


class Received(NamedTuple):
    """One message as it came from the broker."""

    topic: str
    payload: bytes
    oversized: int = 0
    """Bytes of a message that is longer than the limit; its payload is cut."""


Good: TypeAlias = tuple[Received, Row]
"""A message of one row, and the row."""
Refused: TypeAlias = tuple[Received, str]
"""A message that is no new row, and the reason."""


@dataclass(slots=True)
class Sorted:
    """Messages by what they hold."""

    rows: list[Good] = field(default_factory=list)
    refused: list[Refused] = field(default_factory=list)
    events: list[Received] = field(default_factory=list)
    asks: list[Received] = field(default_factory=list)


def sort(messages: Iterable[Received]) -> Sorted:
    """Read the rows; events and questions are set apart as they came."""
    found = Sorted()
    power: list[tuple[Received, topics.Place]] = []
    for message in messages:
        place = topics.place(message.topic)
        if place.kind == "power" and not message.oversized:
            power.append((message, place))
            continue
        try:
            if place.kind == "event":
                found.events.append(message)
            elif place.kind == "ask":
                found.asks.append(message)
            elif place.kind == "window" and not message.oversized:
                _sort_window(message, place, found)
            else:
                found.rows.append((message, _row(message, place)))
        except ValueError as error:
            found.refused.append((message, str(error)))
    for (message, place), row in zip(power, parse_each([message.payload for message, _ in power]), strict=True):
        if isinstance(row, ValueError):
            found.refused.append((message, str(row)))
        elif row.device == place.device and row.channel == place.channel:
            found.rows.append((message, row))
        else:
            found.refused.append((message, _elsewhere(row)))
    return found


def message_row(message: Received) -> Row | PowerEvent:
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


def _sort_window(message: Received, place: topics.Place, found: Sorted) -> None:
    """Raises ValueError for a window that is no list; what is wrong in it alone is refused alone."""
    for payload in payloads_of(message.topic, message.payload):
        part = Received(message.topic, payload)
        try:
            found.rows.append((part, _row(part, place)))
        except ValueError as error:
            found.refused.append((part, str(error)))


def _row(message: Received, place: topics.Place) -> Row:
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
