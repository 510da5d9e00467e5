"""What a Parquet file would need in memory, by its metadata, before a byte of its values is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from acqd.errors import InputError

MOST_CELLS = 400_000_000
"""3.2 GB as double precision numbers: a robot's log of a week, 40 columns at 16 Hz. Equal values take hardly a byte in
the file, so its size says nothing."""


def check_size(path: Path, metadata: Any) -> None:
    """Raises InputError for more rows and columns than are read at once; `metadata` as pyarrow has it."""
    check_cells(path, int(metadata.num_rows), int(metadata.num_columns))


def check_cells(path: Path, rows: int, columns: int) -> None:
    """Raises InputError for more rows and columns than are read at once."""
    if rows * max(columns, 1) > MOST_CELLS:
        raise InputError(
            path,
            f"holds {rows} rows of {columns} columns, {rows * columns / MOST_CELLS:.1f} times what is read at once; "
            "split the file",
        )
