"""Where the commands print for people."""

from __future__ import annotations

from rich.console import Console

_LEAST_WIDTH = 110
"""Columns of a table: long lines are better than truncated numbers."""


def terminal(*, stderr: bool = False, soft_wrap: bool = True, tables: bool = False) -> Console:
    """A console that prints brackets as they are: names of files and columns are no markup.

    `tables` makes the console wide enough for the numbers of a table.
    """
    console = Console(stderr=stderr, soft_wrap=soft_wrap, highlight=False, markup=False)
    if tables:
        console.width = max(console.width, _LEAST_WIDTH)
    return console
