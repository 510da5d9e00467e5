"""The live table of power per channel, for 80 columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from acqd.cli.folded_table import Table

_FORMATS = {
    "Vrms": ("V", ".1f"), "Irms": ("A", ".3f"), "P": ("W", ".1f"), "S": ("VA", ".1f"), "PF": ("", ".3f"),
    "f": ("Hz", ".3f"),
}  # fmt: skip
_KWH_PREFIXES = ((1e-3, 1e6, "mWh", ".0f"), (1.0, 1e3, "Wh", ".3f"), (1e3, 1.0, "kWh", ".4f"))
"""Largest energy, factor, unit and form."""


def power_table(
    rows: Mapping[tuple[str, str], Mapping[str, Any]], title: str, traces: Mapping[tuple[str, str], str] | None = None
) -> Table:
    """The table of rows or summaries by (device, channel); `traces`: the recent power as a line of blocks.

    Flags that all rows have are in the title.
    """
    common = set.intersection(*(set(row["flags"]) for row in rows.values())) if rows else set()
    title = "  ".join([title, *sorted(common)])
    shown = {name: form for name, form in _FORMATS.items() if traces is None or name != "S"}
    several = len({device for device, _ in rows}) > 1
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for name in (["device"] if several else []) + ["channel"]:
        table.add_column(name, no_wrap=True)
    for name, (unit, _) in shown.items():
        table.add_column(f"{name} [{unit}]" if unit else name, justify="right", no_wrap=True)
    table.add_column("W", justify="right", no_wrap=True)
    if traces is not None:
        table.add_column("P, 60 s", no_wrap=True)
    table.add_column("flags" if any(set(row["flags"]) - common for row in rows.values()) else "", overflow="fold")
    for (device, channel), row in sorted(rows.items()):
        cells = [_cell(row[name], form) for name, (_, form) in shown.items()]
        trace = [] if traces is None else [traces.get((device, channel), "")]
        flags = " ".join(flag for flag in row["flags"] if flag not in common)
        table.add_row(*([device] if several else []), channel, *cells, energy(row["W"]), *trace, flags)
    return table


def energy(kwh: float | None) -> str:
    """An energy [kWh] in the unit that suits it."""
    if kwh is None:
        return "-"
    for limit, factor, unit, form in _KWH_PREFIXES:
        if abs(kwh) < limit:
            return f"{format(kwh * factor, form)} {unit}"
    return f"{kwh / 1e3:.4f} MWh"


def _cell(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
