"""The register row: all registers of a channel, once a minute, as message and SQL columns alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from acqd.telemetry.row import SCHEMA, Channel, Integer, Name, Number, decoded
from acqd.timestamps import filetime


@dataclass(slots=True)
class RegisterRow:
    """Field order is column order. None where the device has no such register."""

    device: Name
    channel: Channel
    boot: Name
    seq: Integer
    """Number of the window after which the registers were read; `power` has a row with the same key."""
    time: str
    """RFC 3339 UTC: the second at whose end that window is."""
    filetime: Integer
    """The same in NTFS FILETIME."""
    W_import: Number
    """kWh."""
    W_export: Number
    W_reactive_I: Number = None
    """kvarh of quadrant I of IEC 62053-23, and so on."""
    W_reactive_II: Number = None
    W_reactive_III: Number = None
    W_reactive_IV: Number = None
    P_demand: Number = None
    """W, mean imported power of the last quarter hour."""
    P_demand_max: Number = None
    P_demand_max_start: Number = None
    """Unix time of the start of that quarter hour [s]."""
    schema: Annotated[int, Meta(ge=SCHEMA, le=SCHEMA)] = SCHEMA

    def to_json(self) -> bytes:
        """The MQTT payload, without a line end."""
        return _encoder.encode(self)


_encoder = msgspec.json.Encoder()
_decoder = msgspec.json.Decoder(RegisterRow)
_NAMES = [field.name for field in fields(RegisterRow)]
NUMBERS = _NAMES[_NAMES.index("W_import") : _NAMES.index("schema")]
"""Fields that hold one number or None."""


def parse_registers(payload: bytes) -> RegisterRow:
    """The row in a payload. Raises ValueError that says which field is wrong and why."""
    return decoded(_decoder, payload)


def register_row(summary: Mapping[str, Any]) -> RegisterRow:
    """The registers in a summary of a second."""
    device, channel, boot, seq, time = (summary[name] for name in ("device", "channel", "boot", "seq", "time"))
    ns = round(datetime.fromisoformat(time).timestamp()) * 10**9
    numbers: list[Any] = [summary.get(name) for name in NUMBERS]
    return RegisterRow(device, channel, boot, seq, time, filetime(ns), *numbers)


class OnceAMinute:
    """Which of the summaries of several channels are the first of a minute of UTC."""

    def __init__(self) -> None:
        self._minutes: dict[tuple[str, str], str] = {}

    def due(self, summary: Mapping[str, Any]) -> bool:
        """Whether this is the first of its channel in a minute, or since the start."""
        channel, minute = (summary["device"], summary["channel"]), summary["time"][: len("2021-07-13T10:15")]
        before, self._minutes[channel] = self._minutes.get(channel), minute
        return bool(before != minute)
