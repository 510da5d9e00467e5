"""Sparkplug B payloads: protocol buffers of sparkplug_b.proto, of which acqd needs four kinds of metrics."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

from acqd.varint import varint

_INT64, _DOUBLE, _BOOLEAN, _STRING = 4, 10, 11, 12
"""Data types (Sparkplug 3.0, 6.4.16)."""
Value = float | int | bool | str | None


@dataclass(frozen=True, slots=True)
class Metric:
    """One value with its name and time."""

    name: str
    value: Value
    time_ms: int
    kind: type = float
    """Of the value, also where that is None."""


def payload(time_ms: int, metrics: Iterable[Metric], seq: int | None = None) -> bytes:
    """The message; `seq` is 0 to 255, and absent in a death of a node."""
    parts = [_number(1, time_ms), *(_bytes(2, _metric(metric)) for metric in metrics)]
    return b"".join(parts if seq is None else [*parts, _number(3, seq)])


def _metric(metric: Metric) -> bytes:
    head = _bytes(1, metric.name.encode()) + _number(3, metric.time_ms)
    if metric.kind is bool:
        return head + _number(4, _BOOLEAN) + (_absent(metric) or _number(14, int(bool(metric.value))))
    if metric.kind is int:
        return head + _number(4, _INT64) + (_absent(metric) or _number(11, int(metric.value or 0) % 2**64))
    if metric.kind is str:
        return head + _number(4, _STRING) + (_absent(metric) or _bytes(15, str(metric.value).encode()))
    return head + _number(4, _DOUBLE) + (_absent(metric) or _key(13, 1) + struct.pack("<d", float(metric.value or 0.0)))


def _absent(metric: Metric) -> bytes:
    return _number(7, 1) if metric.value is None else b""


def _key(field: int, wire: int) -> bytes:
    return varint(field << 3 | wire)


def _number(field: int, value: int) -> bytes:
    return _key(field, 0) + varint(value)


def _bytes(field: int, value: bytes) -> bytes:
    return _key(field, 2) + varint(len(value)) + value


def asks_for_rebirth(content: bytes) -> bool:
    """Whether a command to the node names `Node Control/Rebirth`; a node of acqd obeys no other command."""
    return b"Node Control/Rebirth" in content
