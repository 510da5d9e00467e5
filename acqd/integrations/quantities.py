"""The quantities of rows and summaries as other programs want them described."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of a row or summary."""

    key: str
    """In the JSON message."""
    title: str
    unit: str
    """"" for a ratio."""
    unece: str
    """Common code of the unit (UNECE Recommendation 20), which OPC UA identifies units by."""
    device_class: str
    """Of Home Assistant."""
    digits: int
    """After the decimal point that a display needs."""


POWER = Quantity("P", "Active power", "W", "WTT", "power", 1)
ROW = (
    POWER,
    Quantity("S", "Apparent power", "VA", "D46", "apparent_power", 1),
    Quantity("PF", "Power factor", "", "C62", "power_factor", 3),
    Quantity("Vrms", "Voltage", "V", "VLT", "voltage", 1),
    Quantity("Irms", "Current", "A", "AMP", "current", 3),
    Quantity("f", "Frequency", "Hz", "HTZ", "frequency", 3),
    Quantity("W", "Net energy", "kWh", "KWH", "energy", 3),
)
"""Of every row."""
IMPORTED = Quantity("W_import", "Energy", "kWh", "KWH", "energy", 3)
EXPORTED = Quantity("W_export", "Returned energy", "kWh", "KWH", "energy", 3)
SUMMARY = (*ROW, IMPORTED, EXPORTED)
"""Of every 1 s summary."""
