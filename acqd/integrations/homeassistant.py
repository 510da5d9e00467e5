"""Home Assistant discovers every channel's quantities by retained messages; states come from the 1 s summaries.

https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery, https://www.home-assistant.io/integrations/sensor.mqtt/
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import orjson

from acqd import __version__
from acqd.integrations.daemons import Daemons
from acqd.integrations.plain import summary_of
from acqd.integrations.quantities import EXPORTED, IMPORTED, POWER, SUMMARY, Quantity
from acqd.telemetry import topics
from acqd.telemetry.message import Message

_OURS = "acqd"
_ONLINE = "{{ 'offline' if value == 'offline' else 'online' }}"
"""The status topic holds JSON while a daemon is online."""
_FLAGS = "{{ {'flags': value_json.flags, 'time': value_json.time} | tojson }}"
_STATE_CLASS = {"W": "total", IMPORTED.key: "total_increasing", EXPORTED.key: "total_increasing"}
_QUIET = ("S", "W", EXPORTED.key)
"""Quantities that a user enables by hand."""


@dataclass(frozen=True, slots=True)
class Place:
    """A channel, and how its values are known to be current."""

    device: str
    channel: str
    daemon: str | None
    expire_s: int = 60
    simulated: bool = False


def node(device: str) -> str:
    """A device's name with the characters that a discovery topic may have; different for different names."""
    plain = re.sub(r"[^A-Za-z0-9_-]", "-", device)
    return plain if plain == device else f"{plain}-{hashlib.sha256(device.encode()).hexdigest()[:6]}"


def config_topic(prefix: str, place: Place, quantity: Quantity) -> str:
    """Where the configuration of an entity is kept."""
    return f"{prefix}/sensor/acqd_{node(place.device)}/{place.channel}_{quantity.key}/config"


def config(place: Place, quantity: Quantity) -> dict[str, Any]:
    """The configuration of the entity of one quantity of one channel."""
    entity = f"acqd_{node(place.device)}_{place.channel}_{quantity.key}"
    message: dict[str, Any] = {
        "name": f"{place.channel} {quantity.title.lower()}",
        "unique_id": entity,
        "object_id": entity,
        "state_topic": topics.summary(place.device, place.channel),
        "value_template": f"{{{{ value_json.{quantity.key} }}}}",
        "device_class": quantity.device_class,
        "state_class": _STATE_CLASS.get(quantity.key, "measurement"),
        "suggested_display_precision": quantity.digits,
        "device": {
            "identifiers": [f"acqd_{place.device}"],
            "name": place.device,
            "manufacturer": _OURS,
            "model": "power meter (simulated)" if place.simulated else "power meter",
        },
        "origin": {"name": _OURS, "sw_version": __version__},
    }
    if quantity.unit:
        message["unit_of_measurement"] = quantity.unit
    if quantity.key in _QUIET:
        message["enabled_by_default"] = False
    if quantity == POWER:
        message |= {"json_attributes_topic": message["state_topic"], "json_attributes_template": _FLAGS}
    return message | _currency(place)


def _currency(place: Place) -> dict[str, Any]:
    """How Home Assistant knows that a value is out of date."""
    keys: dict[str, Any] = {}
    if place.daemon is not None:
        keys = {"availability_topic": topics.status(place.daemon), "availability_template": _ONLINE}
    if place.expire_s:
        keys["expire_after"] = place.expire_s
    return keys


@dataclass(slots=True)
class Discovery:
    """Announces what summaries show: a channel's quantities when they have a value for the first time."""

    prefix: str = "homeassistant"
    expire_s: int = 60
    channels: Sequence[str] = ("L1", "L2", "L3", "total")
    _daemons: Daemons = field(default_factory=Daemons)
    _sent: dict[str, bytes] = field(default_factory=dict)

    def subscriptions(self) -> Sequence[str]:
        """States first: the first summary then has its daemon."""
        return topics.ALL_STATUS, topics.ALL_SUMMARIES

    def will(self) -> None:
        """None: entities stay when the bridge is stopped."""

    def begin(self) -> Iterable[Message]:
        """A broker without persistence has lost the messages: every summary announces its channel again."""
        self._sent.clear()
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A status or a summary."""
        if topic.endswith("/status"):
            self._daemons.take(topic.split("/")[1], payload)
            return ()
        summary = summary_of(topic, payload)
        if summary is None or summary["channel"] not in self.channels:
            return ()
        device, channel = str(summary["device"]), str(summary["channel"])
        daemon = self._daemons.of(device, str(summary.get("boot", "")))
        simulated = "simulated" in (summary.get("flags") or [])
        place = Place(device, channel, daemon, self.expire_s, simulated)
        return list(self._news(place, summary))

    def tick(self) -> Iterable[Message]:
        """Nothing is due."""
        return ()

    @property
    def announced(self) -> int:
        """Entities."""
        return len(self._sent)

    def _news(self, place: Place, summary: dict[str, Any]) -> Iterator[Message]:
        """Configurations that are new or have changed."""
        for quantity in SUMMARY:
            topic = config_topic(self.prefix, place, quantity)
            if topic not in self._sent and summary.get(quantity.key) is None:
                continue
            payload = orjson.dumps(config(place, quantity))
            if self._sent.get(topic) != payload:
                self._sent[topic] = payload
                yield Message(topic, payload, retain=True)


@dataclass(slots=True)
class Removal:
    """Deletes the configurations that Discovery has left with the broker, by empty retained messages."""

    prefix: str = "homeassistant"
    device: str | None = None
    """Only this device; None: all."""
    removed: int = 0

    def subscriptions(self) -> Sequence[str]:
        """Retained configurations."""
        return (f"{self.prefix}/sensor/+/+/config",)

    def will(self) -> None:
        """No last will."""

    def begin(self) -> Iterable[Message]:
        """Nothing to send."""
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A configuration; other programs' configurations stay."""
        try:
            found = orjson.loads(payload)
            ours = found["origin"]["name"] == _OURS and found["device"]["manufacturer"] == _OURS
            name = found["device"]["name"]
        except (orjson.JSONDecodeError, KeyError, TypeError):
            return ()
        if not ours or self.device not in (None, name):
            return ()
        self.removed += 1
        return [Message(topic, b"", retain=True)]

    def tick(self) -> Iterable[Message]:
        """Nothing is due."""
        return ()
