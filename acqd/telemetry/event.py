"""The event message: one voltage event, as MQTT payload, JSON line and SQL columns alike."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import msgspec
from msgspec import Meta

from acqd.metering.quality.event import Event, Kind
from acqd.telemetry.row import CHANNELS, Channel, Integer, Name, decoded
from acqd.timestamps import filetime, rfc3339

SCHEMA = 1
_Volts = Annotated[float, Meta(ge=0, le=1e9)]


@dataclass(slots=True)
class PowerEvent:
    """Field order is column order. The messages at start and end have the same key: device, boot and number."""

    device: Name
    boot: Name
    """One daemon start."""
    number: Integer
    """Of the events since that start."""
    kind: Kind
    """`rvc` is a rapid voltage change."""
    time: str
    """RFC 3339 UTC of its start."""
    filetime: Integer
    """The same in NTFS FILETIME."""
    duration: Annotated[float, Meta(ge=0, le=1e10)] | None
    """s; None: it goes on, and another message will say how it has ended."""
    extreme: _Volts
    """V: residual voltage of a dip or interruption, maximum of a swell, largest change of an rvc."""
    reference: Annotated[float, Meta(gt=0, le=1e9)]
    """V: what 100 % is."""
    sliding: bool
    """The reference follows the voltage; otherwise somebody has declared it."""
    steady_change: _Volts | None
    """V: of an rvc, between the steady voltages before and after it."""
    phases: Annotated[list[Channel], Meta(max_length=4)]
    """Those that crossed the threshold."""
    flags: Annotated[list[Name], Meta(max_length=32)]
    waveform: Annotated[str, Meta(max_length=128)] | None
    """Name of the file with the samples, in the state folder of the daemon."""
    schema: Annotated[int, Meta(ge=SCHEMA, le=SCHEMA)] = SCHEMA
    archive: Annotated[str, Meta(max_length=160)] | None = None
    """Where the event begins in the archive: DEVICE/FILE#SAMPLE, counted from the first sample of the file."""

    @property
    def seq(self) -> int:
        """Number of the message since the daemon's start, for spool and receipts: two for every event."""
        return message_number(self.number, ended=self.duration is not None)

    def to_json(self) -> bytes:
        """The MQTT payload, without a line end."""
        return _encoder.encode(self)


_decoder = msgspec.json.Decoder(PowerEvent)
_encoder = msgspec.json.Encoder()


def message_number(number: int, *, ended: bool) -> int:
    """Of the message at the start or at the end of an event."""
    return 2 * number + ended


def message_of(
    event: Event, device: str, boot: str, *, sliding: bool, waveform: str | None = None, archive: str | None = None
) -> PowerEvent:
    """The message of an event."""
    return PowerEvent(
        device, boot, event.number, event.kind, rfc3339(event.utc_ns), filetime(event.utc_ns), event.duration,
        event.extreme, event.reference, sliding, event.steady_change, [CHANNELS[k] for k in event.phases],
        sorted(event.flags), waveform, archive=archive,
    )  # fmt: skip


def event_lines(events: Iterable[PowerEvent]) -> bytes:
    """The events as JSON lines."""
    return _encoder.encode_lines(events)


def parse_event(payload: bytes) -> PowerEvent:
    """The event in a payload. Raises ValueError that says which field is wrong and why."""
    return decoded(_decoder, payload)
