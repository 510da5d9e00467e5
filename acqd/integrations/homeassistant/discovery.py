"""Announces channels' quantities by retained messages; states come from summaries and rows of power quality."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import orjson

from acqd.energy.running import Running
from acqd.integrations.daemons import Daemons
from acqd.integrations.homeassistant.costs import Costs
from acqd.integrations.homeassistant.entities import (
    COSTS,
    Place,
    config,
    config_topic,
    cost_config,
    cost_topic,
    event_config,
    event_topic,
    quality_config,
)
from acqd.integrations.plain import summary_of
from acqd.integrations.quality import QUALITY, quality_of
from acqd.integrations.quantities import SUMMARY
from acqd.telemetry import topics
from acqd.telemetry.message import Message

_SHOWN = tuple(quantity for quantity in QUALITY if quantity.key in ("V_thds", "I_thds", "V_u2"))
"""Of power quality: the other numbers are for other programs."""


@dataclass(slots=True)
class Discovery:
    """Announces what summaries show: a channel's quantities when they have a value for the first time."""

    prefix: str = "homeassistant"
    expire_s: int = 60
    channels: Sequence[str] = ("L1", "L2", "L3", "total")
    energies: Callable[[], Sequence[Running] | None] = lambda: None
    """What is known of the energy of all devices, when there is news; without a tariff: never."""
    _daemons: Daemons = field(default_factory=Daemons)
    _sent: dict[str, bytes] = field(default_factory=dict)
    _costs: Costs = field(default_factory=Costs)
    _fast: set[tuple[str, str]] = field(default_factory=set)
    """Channels with power quality every 3 s."""

    def subscriptions(self) -> Sequence[str]:
        """States first: the first summary then has its daemon."""
        return topics.ALL_STATUS, topics.ALL_SUMMARIES, topics.ALL_QUALITY

    def will(self) -> None:
        """None: entities stay when the bridge is stopped."""

    def begin(self) -> Iterable[Message]:
        """A broker without persistence has lost the messages: every summary announces its channel again."""
        self._sent.clear()
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A status, a summary or power quality."""
        if topic.endswith("/status"):
            return list(self._state(topic.split("/")[1], payload))
        if topic.endswith("/quality"):
            return list(self._quality(topic, payload))
        summary = summary_of(topic, payload)
        if summary is None or summary["channel"] not in self.channels:
            return ()
        device, channel = str(summary["device"]), str(summary["channel"])
        daemon = self._daemons.of(device, str(summary.get("boot", "")))
        simulated = "simulated" in (summary.get("flags") or [])
        place = Place(device, channel, daemon, self.expire_s, simulated)
        return list(self._news(place, summary))

    def tick(self) -> Iterable[Message]:
        """Costs, once a minute."""
        for running in self.energies() or ():
            place = Place(running.device, "total", self._daemons.of(running.device), self.expire_s, running.simulated)
            messages = self._costs.messages(running)
            for cost in COSTS:
                where = cost_topic(self.prefix, running.device, cost)
                if where in self._sent or self._costs.has(running, cost.key):
                    yield from self._changed(where, cost_config(place, cost))
            yield from messages

    @property
    def announced(self) -> int:
        """Entities."""
        return len(self._sent)

    def _news(self, place: Place, summary: dict[str, Any]) -> Iterator[Message]:
        """Configurations that are new or have changed."""
        for quantity in SUMMARY:
            topic = config_topic(self.prefix, place, quantity)
            if topic in self._sent or summary.get(quantity.key) is not None:
                yield from self._changed(topic, config(place, quantity))

    def _quality(self, topic: str, payload: bytes) -> Iterator[Message]:
        """THD of a phase, unbalance of all: of intervals of 3 s, or of ten minutes where there are no shorter ones."""
        row = quality_of(topic, payload)
        if row is None or row.channel not in self.channels or row.aggregation not in ("150/180", "10min"):
            return
        key = (row.device, row.channel)
        if row.aggregation == "150/180":
            self._fast.add(key)
        elif key in self._fast:
            return
        daemon = self._daemons.of(row.device, row.boot)
        place = Place(row.device, row.channel, daemon, self.expire_s, "simulated" in row.flags)
        for quantity in _SHOWN:
            where = config_topic(self.prefix, place, quantity)
            if where in self._sent or getattr(row, quantity.key) is not None:
                nominal_s = 3.0 if row.aggregation == "150/180" else 600.0
                yield from self._changed(where, quality_config(place, quantity, row.aggregation, nominal_s))

    def _state(self, daemon: str, payload: bytes) -> Iterator[Message]:
        """The event entities of a daemon's devices: their first event must find them there."""
        self._daemons.take(daemon, payload)
        for place in _watched(daemon, payload):
            yield from self._changed(event_topic(self.prefix, place.device), event_config(place))

    def _changed(self, topic: str, content: dict[str, Any]) -> Iterator[Message]:
        payload = orjson.dumps(content)
        if self._sent.get(topic) != payload:
            self._sent[topic] = payload
            yield Message(topic, payload, retain=True)


def _watched(daemon: str, payload: bytes) -> Iterator[Place]:
    """Devices whose voltage the daemon watches for events."""
    try:
        status: Any = orjson.loads(payload)
    except orjson.JSONDecodeError:
        return
    names = status.get("events") if isinstance(status, dict) else None
    for name in names if isinstance(names, list) else ():
        if isinstance(name, str) and topics.valid_device(name):
            yield Place(name, "total", daemon, simulated=bool(status.get("simulated")))
