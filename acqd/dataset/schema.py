"""Columns of a recording in its file: times as UTC timestamps, units in the metadata."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.dataset.parquet import OtherWriterError, read_parquet, write_parquet
from acqd.errors import InputError
from acqd.extras import require
from acqd.robot.labels import from_numbers
from acqd.robot.log_layout import LABELS

TIME = "time"
_UNITS = {
    "P": "W",
    "Vrms": "V",
    "q": "rad",
    "qd": "rad/s",
    "tau": "Nm",
    "current": "A",
    "temperature": "degC",
    "brake": "1",
    "tool": "1",
}
_SLIDING = {"q": "m", "qd": "m/s", "tau": "N"}


def unit_of(column: str, sliding: tuple[int, ...] = ()) -> str | None:
    """Unit of a column such as `P` or `tau3`; `sliding` are the prismatic joints from 0. None: it has no unit."""
    quantity, axis = re.fullmatch(r"(.*?)(\d*)", column).groups()  # type: ignore[union-attr]
    slides = axis != "" and int(axis) - 1 in sliding
    return _SLIDING.get(quantity, _UNITS.get(quantity)) if slides else _UNITS.get(quantity)


def units_of(columns: Iterable[str], sliding: tuple[int, ...] = ()) -> dict[str, str]:
    """Units by column, of the columns that have one."""
    units = {name: unit_of(name, sliding) for name in columns}
    return {name: unit for name, unit in units.items() if unit is not None}


def write_columns(
    file: Path, time_ns: NDArray[np.int64], columns: Mapping[str, NDArray[Any]], sliding: tuple[int, ...] = ()
) -> None:
    """Write a recording: the column `time`, then `columns` [T] each. Raises OSError."""
    stamps = np.asarray(time_ns, dtype=np.int64).astype("datetime64[ns]")
    write_parquet(file, {TIME: stamps, **columns}, units_of(columns, sliding))


def read_columns(file: Path) -> dict[str, NDArray[Any]]:
    """The columns [T] of a recording's file by name, its time as `time_ns` (int64). Raises InputError, UserError.

    Labels are text. Files of versions that wrote with pyarrow are read by pyarrow.
    """
    if not file.is_file():
        raise InputError(file, f"{'is no file' if file.exists() else 'no such file'}; build the dataset again")
    try:
        columns = read_parquet(file)
    except OtherWriterError as other:  # acqd up to 0.3.0 wrote with pyarrow
        require(f"{file}, {other},", ("pyarrow",), "parquet")
        from acqd.dataset.arrow import read_file

        columns = read_file(file)
    except (OSError, ValueError) as error:
        raise InputError(file, f"cannot be read ({error}); build the dataset again") from None
    for name in columns.keys() & set(LABELS):
        if columns[name].dtype != object:  # earlier versions stored numbers
            columns[name] = from_numbers(columns[name])
    if TIME in columns:
        columns["time_ns"] = columns.pop(TIME).astype(np.int64)
    return columns
