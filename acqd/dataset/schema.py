"""Columns of a recording in Arrow and Parquet: times as UTC timestamps, units in the metadata of the fields."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from numpy.typing import NDArray

from acqd.errors import InputError
from acqd.parquet_size import check_size
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
UTC_NS = pa.timestamp("ns", tz="UTC")


def unit_of(column: str, sliding: tuple[int, ...] = ()) -> str | None:
    """Unit of a column such as `P` or `tau3`; `sliding` are the prismatic joints from 0. None: it has no unit."""
    quantity, axis = re.fullmatch(r"(.*?)(\d*)", column).groups()  # type: ignore[union-attr]
    slides = axis != "" and int(axis) - 1 in sliding
    return _SLIDING.get(quantity, _UNITS.get(quantity)) if slides else _UNITS.get(quantity)


def recording_table(time_ns: np.ndarray, columns: Mapping[str, np.ndarray], sliding: tuple[int, ...] = ()) -> pa.Table:
    """A table with the column `time`, then `columns` [T] each."""
    fields = [pa.field(TIME, UTC_NS)]
    arrays = [pa.array(np.asarray(time_ns, dtype=np.int64)).cast(UTC_NS)]
    for name, values in columns.items():
        array = pa.array(values).dictionary_encode() if values.dtype == object else pa.array(values)
        unit = unit_of(name, sliding)
        fields.append(pa.field(name, array.type, metadata=None if unit is None else {"unit": unit}))
        arrays.append(array)
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def read_columns(file: Path) -> dict[str, NDArray[Any]]:
    """The columns of a recording's file, by name, as `columns_of`. Raises InputError."""
    if not file.is_file():
        raise InputError(file, f"{'is no file' if file.exists() else 'no such file'}; build the dataset again")
    try:
        # not read_table, which imports pyarrow.dataset
        with pyarrow.parquet.ParquetFile(file) as parquet:
            check_size(file, parquet.metadata)
            return columns_of(parquet.read())
    except (OSError, pa.ArrowInvalid) as error:
        raise InputError(file, f"cannot be read ({str(error).splitlines()[0]}); build the dataset again") from None


def columns_of(table: pa.Table) -> dict[str, NDArray[Any]]:
    """The columns [T] of a recording, its time as `time_ns` (int64), which is how earlier versions stored it.

    Labels are text; earlier versions stored numbers.
    """
    columns = {name: table[name].to_numpy() for name in table.column_names if name != TIME}
    for name in columns.keys() & set(LABELS):
        if columns[name].dtype != object:
            columns[name] = from_numbers(columns[name])
    if TIME in table.column_names:
        columns["time_ns"] = table[TIME].cast(UTC_NS).cast(pa.int64()).to_numpy()
    return columns
