"""Rows from messages, one row or a whole window each."""

from __future__ import annotations

from acqd.telemetry import topics
from acqd.telemetry.row import PowerRow, parse_row
from acqd.telemetry.row_message import payloads_of

TOPICS = (topics.ALL_POWER, topics.ALL_WINDOWS)


def rows_of(topic: str, payload: bytes) -> list[PowerRow]:
    """The rows of a message; none when one of them is malformed or of another topic."""
    try:
        rows = [parse_row(part) for part in payloads_of(topic, payload)]
    except ValueError:
        return []
    return (
        rows if all(topic in (topics.power(row.device, row.channel), topics.window(row.device)) for row in rows) else []
    )
