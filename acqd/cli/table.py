"""The live table of power per channel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.table import Table

_FORMATS = {
    "Vrms": ("V", ".2f"),
    "Irms": ("A", ".3f"),
    "P": ("W", ".1f"),
    "S": ("VA", ".1f"),
    "PF": ("", ".3f"),
    "f": ("Hz", ".3f"),
    "W": ("kWh", ".6f"),
}


def power_table(rows: Mapping[tuple[str, str], Mapping[str, Any]], title: str) -> Table:
    """The table of rows or summaries by (device, channel)."""
    table = Table(title=title, title_justify="left")
    for name in ("device", "channel"):
        table.add_column(name)
    for name, (unit, _) in _FORMATS.items():
        table.add_column(f"{name} [{unit}]".replace(" []", "").replace("[", "\\["), justify="right")
    table.add_column("flags")
    for (device, channel), row in sorted(rows.items()):
        cells = ["-" if row[name] is None else format(row[name], form) for name, (_, form) in _FORMATS.items()]
        table.add_row(device, channel, *cells, " ".join(row["flags"]))
    return table
