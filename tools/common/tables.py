"""Printing of result tables."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table


def show(*tables: Table, width: int) -> None:
    """Print tables `width` characters wide, whatever the terminal: figures must not be truncated in a log file."""
    console = Console(width=width)
    for table in tables:
        console.print(table)


def verdict(good: bool | None, yes: str, no: str) -> str:
    """A table cell: `yes` in green, `no` in red, nothing for None (there is no target)."""
    if good is None:
        return ""
    return f"[green]{yes}[/]" if good else f"[red]{no}[/]"
