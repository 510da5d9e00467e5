"""Configurations of entities, and where they are kept.

https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery, https://www.home-assistant.io/integrations/sensor.mqtt/,
https://www.home-assistant.io/integrations/event.mqtt/
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, replace
from typing import Any

from acqd import __version__
from acqd.integrations.quality import EVENT_KINDS
from acqd.integrations.quantities import EXPORTED, IMPORTED, POWER, Quantity
from acqd.metering.quality.values import Kind
from acqd.telemetry import topics

OURS = "acqd"
_ONLINE = "{{ 'offline' if value == 'offline' else 'online' }}"
"""The status topic holds JSON while a daemon is online."""
_FLAGS = "{{ {'flags': value_json.flags, 'time': value_json.time} | tojson }}"
_OF_AGGREGATION = "{%% if value_json.aggregation == '%s' %%}{{ value_json.%s }}{%% endif %%}"
"""Home Assistant leaves a state as it is when a template yields nothing."""
_ENDED = (
    "{% if value_json.duration is not none %}{{ {'event_type': value_json.kind, 'extreme_V': value_json.extreme,"
    " 'duration_s': value_json.duration, 'reference_V': value_json.reference, 'phases': value_json.phases,"
    " 'time': value_json.time, 'flags': value_json.flags} | tojson }}{% endif %}"
)
_STATE_CLASS = {"W": "total", IMPORTED.key: "total_increasing", EXPORTED.key: "total_increasing"}
_QUIET = ("S", "W", EXPORTED.key)
"""Quantities that a user enables by hand."""
_INTERVALS = 5
"""Of a slow aggregation, after which its value is out of date."""


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
    """The entity of one quantity of one channel, from the 1 s summaries."""
    message = _sensor(place, quantity) | {
        "state_topic": topics.summary(place.device, place.channel),
        "value_template": f"{{{{ value_json.{quantity.key} }}}}",
        "device_class": quantity.device_class,
        "state_class": _STATE_CLASS.get(quantity.key, "measurement"),
    }
    if quantity.key in _QUIET:
        message["enabled_by_default"] = False
    if quantity == POWER:
        message |= {"json_attributes_topic": message["state_topic"], "json_attributes_template": _FLAGS}
    return message | _currency(place)


def quality_config(place: Place, quantity: Quantity, aggregation: Kind, duration_s: float) -> dict[str, Any]:
    """The entity of one quantity of power quality: the rows of one aggregation, of intervals of `duration_s`."""
    message = _sensor(place, quantity) | {
        "state_topic": f"acqd/{place.device}/{topics.quality_stream(place.channel)}",
        "value_template": _OF_AGGREGATION % (aggregation, quantity.key),
        "state_class": "measurement",
    }
    expire_s = max(place.expire_s, round(_INTERVALS * duration_s)) if place.expire_s else 0
    return message | _currency(replace(place, expire_s=expire_s))


@dataclass(frozen=True, slots=True)
class Cost:
    """A number of `topics.energy`."""

    key: str
    title: str
    template: str
    unit: str
    digits: int
    device_class: str | None = None
    state_class: str = "measurement"


COSTS = (
    Cost("cost_today", "cost today", "today.EUR", "EUR", 2, "monetary", "total"),
    Cost("price", "price", "price", "EUR/kWh", 4),
    Cost("standby_share", "standby this week", "standby_percent", "%", 0),
)
"""The energy dashboard takes the first as "an entity tracking the total costs", the second as a current price."""
_COST_EXPIRE_S = 300
"""Published once a minute."""


def cost_topic(prefix: str, device: str, cost: Cost) -> str:
    """Where the configuration of an entity of cost is kept."""
    return f"{prefix}/sensor/acqd_{node(device)}/{cost.key}/config"


def cost_config(place: Place, cost: Cost) -> dict[str, Any]:
    """The entity of a cost. A total is said since when, so that the recorder adds up days."""
    entity = f"acqd_{node(place.device)}_{cost.key}"
    message: dict[str, Any] = {
        "name": cost.title, "unique_id": entity, "object_id": entity, "state_topic": topics.energy(place.device),
        "value_template": f"{{{{ value_json.{cost.template} }}}}", "unit_of_measurement": cost.unit,
        "suggested_display_precision": cost.digits, "state_class": cost.state_class,
    }  # fmt: skip
    if cost.device_class is not None:
        message["device_class"] = cost.device_class
    if cost.state_class == "total":
        message["last_reset_value_template"] = "{{ value_json.today.since }}"
    expire_s = max(place.expire_s, _COST_EXPIRE_S) if place.expire_s else 0
    return message | _about(place) | _currency(replace(place, daemon=None, expire_s=expire_s))


def event_topic(prefix: str, device: str) -> str:
    """Where the configuration of a device's event entity is kept."""
    return f"{prefix}/event/acqd_{node(device)}/voltage/config"


def event_config(place: Place) -> dict[str, Any]:
    """The entity of a device's voltage events, each when it has ended."""
    entity = f"acqd_{node(place.device)}_voltage_event"
    message = {
        "name": "voltage event",
        "unique_id": entity,
        "object_id": entity,
        "state_topic": topics.event(place.device),
        "event_types": list(EVENT_KINDS),
        "value_template": _ENDED,
    }
    return message | _about(place) | _currency(replace(place, expire_s=0))


def _sensor(place: Place, quantity: Quantity) -> dict[str, Any]:
    entity = f"acqd_{node(place.device)}_{place.channel}_{quantity.key}"
    message: dict[str, Any] = {
        "name": f"{place.channel} {_lowered(quantity.title)}",
        "unique_id": entity,
        "object_id": entity,
        "suggested_display_precision": quantity.digits,
    }
    if quantity.unit:
        message["unit_of_measurement"] = quantity.unit
    return message | _about(place)


def _lowered(title: str) -> str:
    return title if title.endswith("THD") else title.lower()


def _about(place: Place) -> dict[str, Any]:
    return {
        "device": {
            "identifiers": [f"acqd_{place.device}"],
            "name": place.device,
            "manufacturer": OURS,
            "model": "power meter (simulated)" if place.simulated else "power meter",
        },
        "origin": {"name": OURS, "sw_version": __version__},
    }


def _currency(place: Place) -> dict[str, Any]:
    """How Home Assistant knows that a value is out of date."""
    keys: dict[str, Any] = {}
    if place.daemon is not None:
        keys = {"availability_topic": topics.status(place.daemon), "availability_template": _ONLINE}
    if place.expire_s:
        keys["expire_after"] = place.expire_s
    return keys
