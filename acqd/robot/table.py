"""Tables of numbers as robots write them: text with several separators, decimal commas, headers with `%`; Parquet."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acqd.errors import InputError, UserError
from acqd.robot.table_text import Table, joined, text_tables

__all__ = ["Table", "read_table"]


def read_table(path: Path, broken_share: float = 0.0) -> Table:
    """A table separated by commas, semicolons, tabs or spaces, with a header or without, or a Parquet file.

    Blank lines are skipped. Commas are decimal where semicolons, tabs or spaces separate the columns. Up to
    `broken_share` of the rows may have a wrong number of cells. Raises InputError, UserError (Parquet without pyarrow).
    """
    if path.suffix == ".parquet":
        return _read_parquet(path)
    try:
        with path.open("rb") as file:
            tables = list(text_tables(path, file))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    table = joined(tables)
    if len(table.broken) > broken_share * len(table.values):
        row = min(table.broken)
        raise InputError(path, f"row {table.line(row)} {table.broken[row]}")
    return table


def _read_parquet(path: Path) -> Table:
    """Columns of numbers and of time stamps (as Unix seconds); NaN for a column of anything else."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ModuleNotFoundError:
        raise UserError(f"{path}: Parquet needs pyarrow: pip install 'acqd[data]'") from None
    try:
        # not read_table, which imports pyarrow.dataset
        with pyarrow.parquet.ParquetFile(path) as parquet:
            table = parquet.read()
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(path, f"is not a Parquet file ({str(error).splitlines()[0]})") from None
    if not len(table) or not table.num_columns:
        raise InputError(path, "has no rows of numbers")
    columns = []
    for column in table.columns:
        if pyarrow.types.is_timestamp(column.type):
            ns = column.cast(pyarrow.timestamp("ns", column.type.tz), safe=False).cast(pyarrow.int64())
            columns.append(ns.to_numpy().astype(np.float64) / 1e9)
        elif any(is_kind(column.type) for is_kind in (pyarrow.types.is_integer, pyarrow.types.is_floating)):
            columns.append(column.cast(pyarrow.float64(), safe=False).to_numpy())
        elif pyarrow.types.is_boolean(column.type):
            columns.append(column.cast(pyarrow.uint8()).cast(pyarrow.float64()).to_numpy())
        else:
            columns.append(np.full(len(table), np.nan))
    return Table(list(table.schema.names), np.column_stack(columns), np.arange(1, len(table) + 1))
