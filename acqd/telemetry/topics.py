"""Topic names."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

ALL_POWER = "acqd/+/+/power"
"""Every device's rows, one message each."""
ALL_WINDOWS = "acqd/+/window"
"""Every device's rows, one message per window."""
ALL_QUALITY = "acqd/+/+/quality"
"""Every device's rows of power quality."""
ALL_REGISTERS = "acqd/+/+/registers"
"""Every device's registers."""
ALL_EVENTS = "acqd/+/event"
"""Every device's voltage events."""
ALL_SUMMARIES = "acqd/+/+/summary"
ALL_STATUS = "acqd/+/status"
"""State of every daemon."""
ALL_PREDICTIONS = "acqd/+/prediction/live"
"""Power that sidecars predict from live joint angles."""
ALL_ALARMS = "acqd/+/prediction/alarm"
"""Changes of the residual, retained until somebody clears them."""
ALL_JOINTS = "acqd/+/joints"
"""Joint angles for live predictions."""
ALL_SINKS = "acqd/sink/+/status"
"""Every sink's announcement."""
ALL_ASKS = "acqd/+/ask"
"""Questions of the daemons."""
OFFLINE = b"offline"
"""Last will and farewell on the status topic."""
EVENTS = "event"
"""What names the voltage events of a device in spool and receipts, in the place of a channel."""
_QUALITY = "/quality"
_REGISTERS = "/registers"
_PLAIN = re.compile(r"[/+#\0]")
_DEVICE = re.compile(r"(?!\.\.?$)[A-Za-z0-9_.-]{1,64}")
Kind: TypeAlias = Literal["power", "window", "quality", "registers", "event", "ask", "other"]


class Place(NamedTuple):
    """What the messages on a topic hold, and of what."""

    kind: Kind
    device: str = ""
    channel: str = ""
    """Empty for messages of the whole device."""


@lru_cache(4_096)
def place(topic: str) -> Place:
    """By the topics that sinks subscribe to; once a topic, not once a message."""
    match topic.split("/"):
        case ["acqd", device, channel, "power" | "quality" | "registers" as kind]:
            return Place(kind, device, channel)
        case ["acqd", device, "window" | "event" | "ask" as kind]:
            return Place(kind, device)
    return Place("other")


def valid_device(name: str) -> bool:
    """Whether a device name can be part of a topic (and of a file name)."""
    return bool(_DEVICE.fullmatch(name))


def power(device: str, channel: str) -> str:
    """Every window's row, QoS 1."""
    return f"acqd/{device}/{channel}/power"


def quality_stream(channel: str) -> str:
    """What names the rows of power quality of a channel in spool and receipts."""
    return channel + _QUALITY


def is_quality(stream_channel: str) -> bool:
    """Whether a stream holds rows of power quality."""
    return stream_channel.endswith(_QUALITY)


def register_stream(channel: str) -> str:
    """What names the rows of registers of a channel in spool and receipts."""
    return channel + _REGISTERS


def is_registers(stream_channel: str) -> bool:
    """Whether a stream holds rows of registers."""
    return stream_channel.endswith(_REGISTERS)


@lru_cache(maxsize=64)  # every row asks several times
def travels_alone(stream_channel: str) -> bool:
    """Whether the rows of a stream are never in the message of a window: power quality, registers and events."""
    return stream_channel.endswith((_QUALITY, _REGISTERS)) or stream_channel == EVENTS


def row(device: str, stream_channel: str) -> str:
    """Every row of a stream, QoS 1: a channel's windows, power quality or registers, or the events of the device."""
    if stream_channel == EVENTS:
        return event(device)
    return f"acqd/{device}/{stream_channel}" if travels_alone(stream_channel) else power(device, stream_channel)


def window(device: str) -> str:
    """The rows of all channels of a window, QoS 1: where the daemon is configured to send them together."""
    return f"acqd/{device}/window"


def is_window(topic: str) -> bool:
    """Whether messages on this topic hold all rows of a window."""
    return topic.endswith("/window") and topic.count("/") == 2


def event(device: str) -> str:
    """Dips, swells, interruptions and rapid voltage changes as they begin and end, QoS 1."""
    return f"acqd/{device}/event"


def is_event(topic: str) -> bool:
    """Whether messages on this topic are voltage events."""
    return topic.endswith("/event") and topic.count("/") == 2


def summary(device: str, channel: str) -> str:
    """One second's mean, retained."""
    return f"acqd/{device}/{channel}/summary"


def status(device: str) -> str:
    """Retained JSON while online, `offline` otherwise."""
    return f"acqd/{device}/status"


def energy(device: str) -> str:
    """Energy and cost of today and this week, and the price now; retained. `acqd bridge homeassistant` publishes it."""
    return f"acqd/{device}/energy"


def ask(device: str) -> str:
    """What a daemon asks the sinks, and another daemon of its name (telemetry.ask)."""
    return f"acqd/{device}/ask"


def receipt(device: str) -> str:
    """Which rows of the device a sink has stored; only sinks publish here."""
    return f"acqd/{device}/receipt"


def sink_status(client_id: str) -> str:
    """Retained JSON while the sink is subscribed, `offline` otherwise."""
    return f"acqd/sink/{_PLAIN.sub('-', client_id)}/status"
