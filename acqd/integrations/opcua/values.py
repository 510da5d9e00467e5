"""Rows, power quality and events as values of OPC UA: with status and the time of the window."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from asyncua import ua

from acqd.integrations.opcua.quality import ABSENT, GOOD, status_of
from acqd.integrations.quality import EVENT, LIST_QUANTITIES, QUALITY
from acqd.integrations.quantities import ROW, Quantity
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.row import PowerRow

Values = dict[str, ua.DataValue]
_TEXT, _INTEGER, _DOUBLE = ua.VariantType.String, ua.VariantType.Int64, ua.VariantType.Double


def of_row(row: PowerRow) -> Values:
    """Of a window."""
    about = {"boot": ua.Variant(row.boot, _TEXT), "seq": ua.Variant(row.seq, _INTEGER)}
    return _values(row, ROW, row.flags, about)


def of_quality(row: QualityRow) -> Values:
    """Of an aggregation interval; harmonics are arrays."""
    about = {
        "boot": ua.Variant(row.boot, _TEXT), "seq": ua.Variant(row.seq, _INTEGER),
        "rotation": ua.Variant(row.rotation or "", _TEXT), "intervals": ua.Variant(row.intervals, _INTEGER),
    }  # fmt: skip
    return _values(row, (*QUALITY, *LIST_QUANTITIES), row.flags, about)


def of_event(event: PowerEvent) -> Values:
    """Of a voltage event; `active` until it has ended."""
    about = {
        "boot": ua.Variant(event.boot, _TEXT), "number": ua.Variant(event.number, _INTEGER),
        "active": ua.Variant(event.duration is None, ua.VariantType.Boolean),
        "phases": ua.Variant(list(event.phases), _TEXT, is_array=True),
    }  # fmt: skip
    return _values(event, EVENT, event.flags, about)


def _values(source: Any, quantities: Sequence[Quantity], flags: list[str], about: Mapping[str, ua.Variant]) -> Values:
    status, time, now = status_of(flags), datetime.fromisoformat(source.time), datetime.now(UTC)
    variants = {each.key: _number(getattr(source, each.key)) for each in quantities}
    known = {name: status if variant.Value is not None else ABSENT for name, variant in variants.items()}
    texts = {**about, "flags": ua.Variant(list(flags), _TEXT, is_array=True)}
    return {
        name: ua.DataValue(variant, known.get(name, GOOD), SourceTimestamp=time, ServerTimestamp=now)
        for name, variant in {**variants, **texts}.items()
    }


def _number(value: float | list[float | None] | None) -> ua.Variant:
    if value is None:
        return ua.Variant(None, ua.VariantType.Null)
    if isinstance(value, list):
        return ua.Variant([math.nan if each is None else each for each in value], _DOUBLE, is_array=True)
    return ua.Variant(value, _DOUBLE)
