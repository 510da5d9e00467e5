"""Recordings as tables of Arrow, for those who have pyarrow."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from numpy.typing import NDArray

from acqd.dataset.schema import TIME, unit_of
from acqd.errors import InputError
from acqd.parquet_size import check_size

UTC_NS = pa.timestamp("ns", tz="UTC")


def recording_table(time_ns: np.ndarray, columns: Mapping[str, np.ndarray]) -> pa.Table:
    """A table with the column `time`, then `columns` [T] each; units are in the metadata of the fields."""
    fields = [pa.field(TIME, UTC_NS)]
    arrays = [pa.array(np.asarray(time_ns, dtype=np.int64)).cast(UTC_NS)]
    for name, values in columns.items():
        array = pa.array(values).dictionary_encode() if values.dtype == object else pa.array(values)
        unit = unit_of(name)
        fields.append(pa.field(name, array.type, metadata=None if unit is None else {"unit": unit}))
        arrays.append(array)
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def read_file(file: Path) -> dict[str, NDArray[Any]]:
    """The columns [T] of a file that pyarrow wrote, `time` as nanoseconds. Raises InputError."""
    try:
        # not read_table, which imports pyarrow.dataset
        with pyarrow.parquet.ParquetFile(file) as parquet:
            check_size(file, parquet.metadata)
            table = parquet.read()
            columns = {name: table[name].to_numpy() for name in table.column_names if name != TIME}
            if TIME in table.column_names:
                columns[TIME] = table[TIME].cast(UTC_NS).cast(pa.int64()).to_numpy()
            return columns
    except (OSError, pa.ArrowInvalid) as error:
        raise InputError(file, f"cannot be read ({str(error).splitlines()[0]}); build the dataset again") from None
