"""The table of `acqd status` about the sources of a daemon that has several."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.markup import escape

from acqd.cli.folded_table import Table


def show_boxes(console: Console, boxes: list[dict[str, Any]]) -> None:
    """Print one line per source; nothing for a daemon with one source."""
    if not boxes:
        return
    table = Table("source", "state", "last row", "lost", "restarts", "missed", "too long", "windows")
    for box in boxes:
        cycles = box["cycles"] or {}
        restarts = box["restarts"] + cycles.get("restarts", 0)
        figures = (seconds(box["last_row_age_s"]), box["source"]["lost"], restarts, cycles.get("missed", "-"),
                   cycles.get("exceeded", "-"))  # fmt: skip
        table.add_row(escape(box["name"]), _state(box), *(str(figure) for figure in figures), flagged(box["windows"]))
    console.print(table)


def flagged(windows: dict[str, Any] | None) -> str:
    """How many windows of a source have values in doubt, and every flag with its count; empty where nobody counts.

    `simulated` or `unsynchronised` may stand at more windows than are counted: they doubt no value.
    """
    if not windows:
        return ""
    names = sorted(windows["flags"], key=lambda name: -windows["flags"][name])
    told = ", ".join(f"{name} {windows['flags'][name]}" for name in names)
    return f"{windows['flagged']} of {windows['made']} in doubt" + (f"; flags: {told}" if told else "")


def seconds(value: float | None) -> str:
    """A time [s] in a unit that fits."""
    if value is None:
        return "-"
    return f"{value:.1f} s" if value < 120 else f"{value / 60:.0f} min" if value < 7200 else f"{value / 3600:.1f} h"


def _state(box: dict[str, Any]) -> str:
    if box["ended"]:
        return "ended"
    if not box["source"]["connected"]:
        return "[red]away[/]"
    return "delivers" if box["alive"] else "[red]no rows[/]"
