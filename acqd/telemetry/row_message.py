"""MQTT messages of rows: one row on the topic of its channel, or all rows of a window on the topic of its device."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

import msgspec

from acqd.telemetry import topics
from acqd.telemetry.message import Message
from acqd.telemetry.spool import SpooledRow

_array = msgspec.json.Decoder(list[msgspec.Raw])


def messages_of(rows: Sequence[SpooledRow], *, windows: bool) -> list[Message]:
    """One message a row, or with `windows`, one for all rows that follow one another and are of one window."""
    if not windows:
        return [_of_row(row) for row in rows]
    return [_of_window(list(window)) for _, window in groupby(rows, _window)]


def joined(payloads: Iterable[bytes]) -> bytes:
    """The payload of a window: a JSON array of the payloads of its rows."""
    return b"[" + b",".join(payloads) + b"]"


def payloads_of(topic: str, payload: bytes) -> list[bytes]:
    """The payloads of the rows in a message; the rows are not checked.

    Raises ValueError for a window that is no JSON array.
    """
    if not topics.is_window(topic):
        return [payload]
    try:
        return [bytes(part) for part in _array.decode(payload)]
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(f"a window is a JSON array of rows: {str(error)[:200]}") from None


def _window(row: SpooledRow) -> tuple[str, str, int, str]:
    """What the rows of a window have in common; rows of power quality are large, and travel alone, as events do."""
    alone = row.stream.channel if topics.travels_alone(row.stream.channel) else ""
    return row.stream.device, row.stream.boot, row.seq, alone


def _of_row(row: SpooledRow) -> Message:
    stream, seq, payload = row
    return Message(topics.row(stream.device, stream.channel), payload, tag=[(stream, seq)])


def _of_window(rows: Sequence[SpooledRow]) -> Message:
    if topics.travels_alone(rows[0].stream.channel):
        return _of_row(rows[0])
    sent = [(row.stream, row.seq) for row in rows]
    return Message(topics.window(rows[0].stream.device), joined([row.payload for row in rows]), tag=sent)
