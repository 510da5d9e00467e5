"""A block of power rows as a file has them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from acqd.errors import InputError
from acqd.timestamps import Nanoseconds

COLUMNS = ("filetime", "time", "P", "Vrms", "flags", "device", "channel")
"""What is read of a file."""


@dataclass(frozen=True, slots=True)
class Cells:
    """Consecutive rows of a file: the cells of the columns that are read."""

    clock: str
    """Name of the column of times."""
    columns: dict[str, Sequence[object]]
    """[rows] by the column's name; None, or an empty text, where a cell is empty."""
    count: int
    """Number of rows."""
    before: int
    """Number of data rows before them."""
    time_ns: Nanoseconds | None = None
    """[rows] UTC where the file has timestamps with a zone."""


Reader = Callable[[Path, list[str]], Iterator[Cells]]
"""The blocks of a file; what a user should know is added to the list."""


def clock_column(path: Path, names: Sequence[str]) -> str:
    """The column of times of a file with the columns `names`. Raises InputError where a column lacks, or is twice."""
    clock = next((name for name in ("filetime", "time") if name in names), None)
    if clock is None or "P" not in names:
        raise InputError(path, f"needs the columns time (or filetime) and P; it has {', '.join(names[:8])}")
    twice = [name for name in (clock, *COLUMNS[2:]) if names.count(name) > 1]
    if twice:
        raise InputError(path, f"has several columns {twice[0]!r}; expected one: rename or remove the others")
    return clock
