"""Messages as they come from the broker, and the rows in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from acqd.storage import events
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow, parse_quality
from acqd.telemetry.register_row import RegisterRow, parse_registers
from acqd.telemetry.row import PowerRow, parse_row
from acqd.telemetry.row_message import payloads_of

Row: TypeAlias = PowerRow | QualityRow | RegisterRow


@dataclass(frozen=True, slots=True)
class Received:
    """One message as it came from the broker."""

    topic: str
    payload: bytes
    oversized: int = 0
    """Bytes of a message that is longer than the limit; its payload is cut."""


class Parsed(NamedTuple):
    """A message of one row; the reason where it is none."""

    message: Received
    row: Row | None
    reason: str


def rows_apart(messages: Sequence[Received], refused: list[tuple[Received, str]]) -> Iterator[Received]:
    """A message for each row; an invalid window goes to `refused` with the reason."""
    for message in messages:
        if message.oversized or not topics.is_window(message.topic):
            yield message
            continue
        try:
            parts = payloads_of(message.topic, message.payload)
        except ValueError as error:
            refused.append((message, str(error)))
            continue
        for part in parts:
            yield Received(message.topic, part)


def parse(message: Received) -> Parsed:
    """The row in a message of one, or why there is none."""
    try:
        return Parsed(message, _row(message), "")
    except ValueError as error:
        return Parsed(message, None, str(error))


def message_row(message: Received) -> Row | PowerEvent:
    """The row or event in a message of one, whatever its time. Raises ValueError."""
    return events.parsed_event(message) if topics.is_event(message.topic) else _row(message)


def stream_channel(row: Row) -> str:
    """What names the stream of a row in receipts, in the place of a channel."""
    if isinstance(row, QualityRow):
        return topics.quality_stream(row.channel)
    return topics.register_stream(row.channel) if isinstance(row, RegisterRow) else row.channel


def _row(message: Received) -> Row:
    if message.oversized:
        raise ValueError(f"message of {message.oversized} bytes is too large for a row")
    if topics.is_quality(message.topic):
        row: Row = parse_quality(message.payload)
    elif topics.is_registers(message.topic):
        row = parse_registers(message.payload)
    else:
        row = parse_row(message.payload)
    expected = topics.row(row.device, stream_channel(row))
    if message.topic not in (expected, topics.window(row.device)):
        raise ValueError(f"payload is of {expected}, but came by another topic")
    return row
