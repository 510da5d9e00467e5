"""Every quantity as a number of its own on acqd/DEVICE/CHANNEL/QUANTITY, for programs that read no JSON.

Power quality and voltage events are below acqd/DEVICE/CHANNEL/quality and acqd/DEVICE/event.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import orjson

from acqd.daemon.quality_section import BridgedQuality
from acqd.integrations.quality import EVENT, QUALITY, event_of, level, orders, quality_of, subscriptions, wanted
from acqd.integrations.quantities import ROW, SUMMARY
from acqd.integrations.rows import TOPICS, rows_of
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.message import Message
from acqd.telemetry.quality_row import QualityRow


class Plain:
    """Numbers of summaries, or of every row; retained, so that a new reader has them at once.

    A quantity without a value becomes an empty message, which also takes the retained number away.
    """

    def __init__(self, prefix: str, *, every_row: bool = False, quality: BridgedQuality = "150/180") -> None:
        """`quality`: rows of power quality from this aggregation on."""
        self._prefix, self._every_row, self._quality = prefix, every_row, quality
        self._sent: dict[str, bytes] = {}

    def subscriptions(self) -> Sequence[str]:
        """Summaries or rows, power quality and voltage events."""
        return *(TOPICS if self._every_row else (topics.ALL_SUMMARIES,)), *subscriptions(self._quality)

    def will(self) -> None:
        """None: acqd/DEVICE/status says whether numbers are current."""

    def begin(self) -> Iterable[Message]:
        """Nothing is known of what this broker has."""
        self._sent.clear()
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A summary, rows, power quality or an event."""
        if topic.endswith("/quality"):
            if (found := quality_of(topic, payload)) is not None and found.aggregation in wanted(self._quality):
                yield from self._numbers(_of_quality(found))
        elif topics.is_event(topic):
            if (event := event_of(topic, payload)) is not None:
                yield from self._numbers(_of_event(event))
        elif self._every_row:
            for row in rows_of(topic, payload):
                yield from self._numbers(
                    {f"{row.device}/{row.channel}/{each.key}": getattr(row, each.key) for each in ROW}
                )
        elif (summary := summary_of(topic, payload)) is not None:
            place = f"{summary['device']}/{summary['channel']}"
            yield from self._numbers({f"{place}/{each.key}": summary.get(each.key) for each in SUMMARY})

    def tick(self) -> Iterable[Message]:
        """Nothing is due."""
        return ()

    def _numbers(self, values: Mapping[str, float | None]) -> Iterator[Message]:
        """Messages of values by their topics below the prefix."""
        for name, value in values.items():
            topic = f"{self._prefix}/{name}"
            payload = b"" if value is None else repr(float(value)).encode()
            if payload or self._sent.get(topic):
                yield Message(topic, payload, retain=True)
            self._sent[topic] = payload


def _of_quality(row: QualityRow) -> dict[str, float | None]:
    """DEVICE/CHANNEL/quality/150-180/V_thds, .../V_h/3."""
    place = f"{row.device}/{row.channel}/quality/{level(row.aggregation)}"
    numbers = {f"{place}/{each.key}": getattr(row, each.key) for each in QUALITY}
    return numbers | {f"{place}/{name}/{order}": value for name, order, value in orders(row)}


def _of_event(event: PowerEvent) -> dict[str, float | None]:
    """DEVICE/event/dip/extreme ...; `active` is 1 until the event has ended."""
    place = f"{event.device}/event/{event.kind}"
    numbers = {f"{place}/{each.key}": getattr(event, each.key) for each in EVENT}
    return numbers | {f"{place}/active": float(event.duration is None), f"{place}/number": float(event.number)}


def summary_of(topic: str, payload: bytes) -> dict[str, Any] | None:
    """The summary in a message; None for other messages and topics."""
    try:
        summary = orjson.loads(payload)
        device, channel, flags = summary["device"], summary["channel"], summary.get("flags") or []
        right = {type(device), type(channel)} == {str} and topic == topics.summary(device, channel)
    except (orjson.JSONDecodeError, KeyError, TypeError):
        return None
    numbers = right and all(isinstance(summary.get(each.key), (int, float, type(None))) for each in SUMMARY)
    words = isinstance(flags, list) and all(isinstance(flag, str) for flag in flags)
    return summary if numbers and words else None
