"""Rows, power quality and voltage events in InfluxDB's line protocol; times in ns, absent numbers are absent fields."""

from __future__ import annotations

from collections.abc import Mapping

from acqd.integrations.quality import EVENT, QUALITY, orders
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.row import PowerRow
from acqd.timestamps import utc_ns

_TAG = str.maketrans({",": r"\,", "=": r"\=", " ": r"\ ", "\n": "", "\r": "", "\\": "/"})
_TEXT = str.maketrans({'"': r"\"", "\\": r"\\", "\n": ""})
_NUMBERS = ("Vrms", "Irms", "P", "S", "PF", "f", "W")


def line(row: PowerRow, measurement: str = "power") -> str:
    """A row as a point."""
    numbers = [f"{name}={value!r}" for name in _NUMBERS if (value := getattr(row, name)) is not None]
    text = _texts({"boot": row.boot, "flags": " ".join(row.flags)})
    tags = f"device={row.device.translate(_TAG)},channel={row.channel}"
    return f"{measurement},{tags} {','.join([*numbers, f'seq={row.seq}i', *text])} {utc_ns(row.filetime)}"


def quality_line(row: QualityRow, measurement: str = "power") -> str:
    """A row of power quality as a point of POWER_quality; harmonics are V_h1, V_h2 ..."""
    values = {name: getattr(row, name) for name in (*(each.key for each in QUALITY), "duration")}
    values |= {f"{name}{order}": value for name, order, value in orders(row)}
    fields = [f"{name}={value!r}" for name, value in values.items() if value is not None]
    fields += [f"intervals={row.intervals}i", f"seq={row.seq}i"]
    text = {"boot": row.boot, "flags": " ".join(row.flags), "rotation": row.rotation or ""}
    tags = f"device={row.device.translate(_TAG)},channel={row.channel},aggregation={row.aggregation}"
    return f"{measurement}_quality,{tags} {','.join([*fields, *_texts(text)])} {utc_ns(row.filetime)}"


def event_line(event: PowerEvent, measurement: str = "power") -> str:
    """A voltage event as a point of POWER_event at its start; the message at its end completes the point."""
    values = {name: getattr(event, name) for name in (each.key for each in EVENT)}
    fields = [f"{name}={value!r}" for name, value in values.items() if value is not None]
    text = {"boot": event.boot, "flags": " ".join(event.flags), "phases": " ".join(event.phases),
            "waveform": event.waveform or ""}  # fmt: skip
    tags = f"device={event.device.translate(_TAG)},kind={event.kind}"
    fields += [f"number={event.number}i", *_texts(text)]
    return f"{measurement}_event,{tags} {','.join(fields)} {utc_ns(event.filetime)}"


def _texts(fields: Mapping[str, str]) -> list[str]:
    return [f'{name}="{value.translate(_TEXT)}"' for name, value in fields.items()]
