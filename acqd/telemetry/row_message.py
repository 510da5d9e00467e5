"""MQTT messages of rows: one row on the topic of its channel, or all rows of a window on the topic of its device."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from acqd.telemetry import topics

_array = msgspec.json.Decoder(list[msgspec.Raw])


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
