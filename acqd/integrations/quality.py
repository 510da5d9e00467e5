"""Rows of power quality and voltage events, as the integrations read them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

from acqd.daemon.quality_section import BridgedQuality
from acqd.integrations.quantities import Quantity
from acqd.metering.quality.event import Kind as EventKind
from acqd.metering.quality.values import PHASE, SYSTEM, Kind
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent, parse_event
from acqd.telemetry.quality_row import LISTS, NUMBERS, QualityRow, from_kind, parse_quality

EVENT_KINDS: tuple[EventKind, ...] = get_args(EventKind)
_FROM_1 = frozenset({"V_h", "I_h", "V_h_angle", "I_h_angle", "P_h"})
"""Lists whose first number is that of the fundamental; the others are numbered from 0 on."""
_CODES = {"V": "VLT", "A": "AMP", "W": "WTT", "VA": "D46", "var": "D44", "%": "P1", "deg": "DD", "Hz": "HTZ", "": "C62"}
_UNITS = {name: each.unit for name, each in (PHASE | SYSTEM).items()} | {"f": "Hz", "rocof": "Hz/s"}
_DIGITS = {"V": 2, "A": 3, "W": 1, "VA": 1, "var": 1, "%": 2, "deg": 2, "Hz": 3, "Hz/s": 4, "": 3, "s": 3}
_TITLES = {
    "f": "Frequency", "rocof": "Rate of change of frequency", "Vrms": "Voltage", "Irms": "Current",
    "P": "Active power", "S": "Apparent power", "PF": "Power factor", "V1": "Fundamental voltage",
    "I1": "Fundamental current", "V1_angle": "Angle of fundamental voltage", "I1_angle": "Angle of fundamental current",
    "P1": "Fundamental active power", "Q1": "Fundamental reactive power", "S1": "Fundamental apparent power",
    "DPF": "Displacement power factor", "V_dc": "DC voltage", "I_dc": "DC current",
    "V_crest": "Crest factor of voltage", "I_crest": "Crest factor of current", "V_thds": "Voltage THD",
    "I_thds": "Current THD", "Se": "Effective apparent power", "PFe": "Effective power factor",
    "V_12": "Voltage L1-L2", "V_23": "Voltage L2-L3", "V_31": "Voltage L3-L1", "V_pos": "Positive sequence of voltage",
    "V_u2": "Voltage unbalance", "V_u0": "Zero sequence of voltage", "I_u2": "Current unbalance",
    "I_u0": "Zero sequence of current", "I_n_derived": "Derived neutral current", "V_ms": "Mains signalling voltage",
    "V_under": "Underdeviation of voltage", "V_over": "Overdeviation of voltage",
    "Pst": "Short-term flicker severity", "Plt": "Long-term flicker severity",
}  # fmt: skip


def _quantity(key: str, title: str, unit: str) -> Quantity:
    return Quantity(key, title, unit, _CODES.get(unit, ""), "", _DIGITS[unit])


QUALITY = tuple(_quantity(key, _TITLES[key], _UNITS.get(key, "")) for key in NUMBERS)
"""Single numbers of a row of power quality."""
LIST_QUANTITIES = (
    _quantity("V_h", "Harmonic subgroups of the voltage, from order 1", "V"),
    _quantity("I_h", "Harmonic subgroups of the current, from order 1", "A"),
    _quantity("V_ih", "Interharmonic subgroups of the voltage, from order 0", "V"),
    _quantity("I_ih", "Interharmonic subgroups of the current, from order 0", "A"),
    _quantity("V_ig", "Interharmonic groups of the voltage, from order 0", "V"),
    _quantity("I_ig", "Interharmonic groups of the current, from order 0", "A"),
    _quantity("V_h_angle", "Angles of the harmonics of the voltage, from order 1", "deg"),
    _quantity("I_h_angle", "Angles of the harmonics of the current, from order 1", "deg"),
    _quantity("P_h", "Active powers of the harmonics, from order 1", "W"),
    _quantity("V_lines", "Lines of the voltage of 5 Hz from 0 to 100 Hz", "V"),
    _quantity("I_lines", "Lines of the current of 5 Hz from 0 to 100 Hz", "A"),
    _quantity("V_bands", "Bands of the voltage of 200 Hz from 2 to 9 kHz", "V"),
    _quantity("I_bands", "Bands of the current of 200 Hz from 2 to 9 kHz", "A"),
    _quantity("V_bands_1k", "Bands of the voltage of 1 kHz from 2 to 9 kHz", "V"),
    _quantity("I_bands_1k", "Bands of the current of 1 kHz from 2 to 9 kHz", "A"),
)
"""Lists of numbers of a row of power quality."""
EVENT = (
    _quantity("extreme", "Residual voltage, maximum or largest change", "V"),
    _quantity("duration", "Duration", "s"),
    _quantity("reference", "Reference voltage", "V"),
    _quantity("steady_change", "Change of the steady voltage", "V"),
)
"""Numbers of a voltage event."""


def subscriptions(shortest: BridgedQuality) -> tuple[str, ...]:
    """Topics that a bridge with this setting needs."""
    return (topics.ALL_EVENTS,) if shortest == "off" else (topics.ALL_QUALITY, topics.ALL_EVENTS)


def wanted(shortest: BridgedQuality) -> frozenset[Kind]:
    """Aggregations that a bridge with this setting passes on."""
    return frozenset() if shortest == "off" else from_kind(shortest)


def quality_of(topic: str, payload: bytes) -> QualityRow | None:
    """The row of power quality in a message; None for what is none, or of another topic."""
    try:
        row = parse_quality(payload)
    except ValueError:
        return None
    return row if topic == topics.row(row.device, topics.quality_stream(row.channel)) else None


def event_of(topic: str, payload: bytes) -> PowerEvent | None:
    """The voltage event in a message; None for what is none, or of another topic."""
    try:
        event = parse_event(payload)
    except ValueError:
        return None
    return event if topic == topics.event(event.device) else None


def level(aggregation: Kind) -> str:
    """An aggregation as a part of a topic or identifier: 10-12, 150-180, 10min, 2h, 10s, Pst, Plt."""
    return aggregation.replace("/", "-")


def orders(row: QualityRow) -> Iterator[tuple[str, int, float | None]]:
    """Name of the list, order, and value of every harmonic and interharmonic."""
    for name in LISTS:
        for order, value in enumerate(getattr(row, name) or (), int(name in _FROM_1)):
            yield name, order, value
