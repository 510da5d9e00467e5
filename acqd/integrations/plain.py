"""Every quantity as a single number on acqd/DEVICE/CHANNEL/QUANTITY, for programs that read no JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import orjson

from acqd.integrations.quantities import ROW, SUMMARY, Quantity
from acqd.integrations.rows import TOPICS, rows_of
from acqd.telemetry import topics
from acqd.telemetry.message import Message


class Plain:
    """Numbers of summaries, or of every row; retained, so that a new reader has them at once.

    A quantity without a value becomes an empty message, which also takes the retained number away.
    """

    def __init__(self, prefix: str, *, every_row: bool = False) -> None:
        self._prefix, self._every_row = prefix, every_row
        self._sent: dict[str, bytes] = {}

    def subscriptions(self) -> Sequence[str]:
        """Summaries, or rows."""
        return TOPICS if self._every_row else (topics.ALL_SUMMARIES,)

    def will(self) -> None:
        """None: acqd/DEVICE/status says whether numbers are current."""

    def begin(self) -> Iterable[Message]:
        """Nothing is known of what this broker has."""
        self._sent.clear()
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A summary or rows."""
        if self._every_row:
            for row in rows_of(topic, payload):
                yield from self._numbers(ROW, {quantity.key: getattr(row, quantity.key) for quantity in ROW}, row)
        elif (summary := summary_of(topic, payload)) is not None:
            yield from self._numbers(SUMMARY, summary, None)

    def tick(self) -> Iterable[Message]:
        """Nothing is due."""
        return ()

    def _numbers(self, quantities: Sequence[Quantity], values: Mapping[str, Any], row: Any) -> Iterator[Message]:
        device, channel = (row.device, row.channel) if row else (values["device"], values["channel"])
        for quantity in quantities:
            value = values.get(quantity.key)
            topic = f"{self._prefix}/{device}/{channel}/{quantity.key}"
            payload = b"" if value is None else repr(float(value)).encode()
            if payload or self._sent.get(topic):
                yield Message(topic, payload, retain=True)
            self._sent[topic] = payload


def summary_of(topic: str, payload: bytes) -> dict[str, Any] | None:
    """The summary in a message; None for other messages and topics."""
    try:
        summary = orjson.loads(payload)
        right = topic == topics.summary(str(summary["device"]), str(summary["channel"]))
    except (orjson.JSONDecodeError, KeyError, TypeError):
        return None
    numbers = right and all(isinstance(summary.get(each.key), (int, float, type(None))) for each in SUMMARY)
    return summary if numbers else None
