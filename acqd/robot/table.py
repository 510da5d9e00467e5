"""Tables of numbers as robots write them: text with several separators, decimal commas, headers with `%`; Parquet."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.extras import require
from acqd.parquet_size import check_size
from acqd.robot.labels import from_cells
from acqd.robot.table_text import NO_ROWS, Table, joined, number_in, text_tables

__all__ = ["Table", "read_table", "text_of"]

_FORMATS = {
    b"\x1f\x8b": "is compressed; unpack it first: gunzip FILE",
    b"BZh": "is compressed; unpack it first: bunzip2 FILE",
    b"\x28\xb5\x2f\xfd": "is compressed; unpack it first: unzstd FILE",
    b"\xfd7zXZ": "is compressed; unpack it first: unxz FILE",
    b"\x04\x22\x4d\x18": "is compressed; unpack it first: unlz4 FILE",
    b"7z\xbc\xaf": "is a 7z archive; unpack it first: 7z x FILE",
    b"PK\x03\x04": "is a zip file, as .xlsx and .npz are; write its table as CSV",
    b"\xd0\xcf\x11\xe0": "is an Excel file; save the sheet as CSV",
    b"\x89HDF": "is an HDF5 file, as .h5 and new .mat are; write its table as CSV or Parquet",
    b"MATLAB": "is a MATLAB file; write its table as CSV: writetable",
    b"\x93NUMPY": "is an array of NumPy; write it as CSV with a header: numpy.savetxt",
    b"PAR1": "is a Parquet file; name it .parquet",
    b"ARROW1": "is a Feather file; write its table as CSV or Parquet",
    b"\x80": "is a pickle of Python, which is not read; write its table as CSV or Parquet",
    b"SQLite format 3": "is an SQLite database; write its table as CSV (a ROS 2 bag is the folder with metadata.yaml)",
    b"version https://git-lfs": "is only a pointer of Git LFS; fetch the file itself: git lfs pull",
    b"{": "is JSON; write its table as CSV",
    b"[{": "is JSON; write its table as CSV",
    b"<": "is a page or XML, not a table; download the file itself",
}
"""What begins like this, and what to do."""
_HEAD = 64
_ENCODINGS = {
    re.compile(rb"\xff\xfe\0\0|\0\0\xfe\xff"): "utf-32",
    re.compile(rb"\xff\xfe|\xfe\xff"): "utf-16",
    re.compile(rb"(?:[\t\n\r -~]\0){8}"): "utf-16-le",
    re.compile(rb"(?:\0[\t\n\r -~]){8}"): "utf-16-be",
}
"""Beginnings of text in other encodings, by their mark or by the zeros between the characters."""
_GENERIC = ("q", "qd", "tau", "current", "temperature")
"""Names of the generic header that are followed by the axis counted from 1."""
_MOST_JOINTS = 64
"""Longest list that becomes columns."""


def read_table(path: Path, broken_share: float = 0.0, words: Collection[str] = ()) -> Table:
    """A table separated by commas, semicolons, tabs or spaces, with a header or without, or a Parquet file.

    Blank lines are skipped. Commas are decimal where semicolons, tabs or spaces separate the columns. Up to
    `broken_share` of the rows may have a wrong number of cells, and a last line that is cut off is left out then;
    otherwise a last line that lacks cells is refused, and one that only lacks digits is a row. Columns named `words`
    are read as text, too. Raises InputError, UserError (Parquet without pyarrow).
    """
    if path.suffix == ".parquet":
        return _read_parquet(path, words)
    try:
        with path.open("rb") as file:
            tables = list(text_tables(path, text_of(path, file), words, by_digits=broken_share > 0))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    table = joined(tables)
    if len(table.broken) > broken_share * len(table.values):
        row = min(table.broken)
        raise InputError(path, f"row {table.line(row)} {table.broken[row]}")
    if table.note and not broken_share:
        raise InputError(path, table.note)
    return table


def text_of(path: Path, file: BinaryIO) -> BinaryIO:
    """The file, or its text in UTF-8. Raises InputError for known formats that are no text."""
    head = file.read(_HEAD)
    file.seek(0)
    for mark, encoding in _ENCODINGS.items():
        if mark.match(head):
            try:
                # a recorder that was stopped hard may leave a part of a character, which is no error
                text = codecs.getincrementaldecoder(encoding)().decode(file.read())
                return io.BytesIO(text.encode())
            except UnicodeError:
                raise InputError(path, f"cannot be read (no UTF-8 text, nor {encoding.upper()})") from None
    if what := foreign_format(head):
        raise InputError(path, what)
    return file


def foreign_format(head: bytes) -> str:
    """What a file that begins with `head` is, if that is no table, and what to do; else empty."""
    return next((what for magic, what in _FORMATS.items() if head.startswith(magic)), "")


def _read_parquet(path: Path, words: Collection[str]) -> Table:
    """Columns of numbers and of time stamps (as Unix seconds); NaN for a column of anything else."""
    require(f"{path}: Parquet", ("pyarrow",), "parquet")
    import pyarrow
    import pyarrow.parquet
    import pyarrow.types

    try:
        # not read_table, which imports pyarrow.dataset
        with pyarrow.parquet.ParquetFile(path) as parquet:
            check_size(path, parquet.metadata)
            table = parquet.read()
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(path, f"is not a Parquet file ({str(error).splitlines()[0]})") from None
    if not len(table) or not table.num_columns:
        raise InputError(path, NO_ROWS)
    table = _without_lists(table)
    names: list[str] = table.schema.names
    columns = [_numbers(column) for column in table.columns]
    texts = {
        k: from_cells(table.column(k).to_pylist())
        for k, name in enumerate(names)
        if name in words and not pyarrow.types.is_nested(table.column(k).type)
    }
    return Table(names, np.column_stack(columns), np.arange(1, len(table) + 1), words=texts)


def _without_lists(table: Any) -> Any:
    """The table with a column for each place of lists: q1 .. q6 of a column q, and NAME_0 .. NAME_5 of another NAME.

    Lists of several lengths, and long ones (images), stay: they hold no joints.
    """
    import pyarrow
    from pyarrow import types

    columns: list[tuple[str, Any]] = []
    for name, column in zip(table.schema.names, table.columns, strict=True):
        kind = column.type
        if not (types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)):
            columns.append((name, column))
            continue
        lists = column.combine_chunks()
        lengths = lists.value_lengths().unique().to_pylist()
        if len(lengths) != 1 or not lengths[0] or lengths[0] > _MOST_JOINTS:
            columns.append((name, column))
            continue
        numbers = lists.flatten()
        for place in range(lengths[0]):
            of_joint = numbers.take(pyarrow.array(range(place, len(numbers), lengths[0]), pyarrow.int64()))
            columns.append((f"{name}{place + 1}" if name in _GENERIC else f"{name}_{place}", of_joint))
    return pyarrow.table([column for _, column in columns], names=[name for name, _ in columns])


def _numbers(column: Any) -> Floats:
    """[rows] of a column of Parquet; NaN where a cell is no number."""
    import pyarrow
    from pyarrow import types

    kind = column.type
    if types.is_timestamp(kind):
        ns = column.cast(pyarrow.timestamp("ns", kind.tz), safe=False).cast(pyarrow.int64())
        return np.asarray(ns.to_numpy().astype(np.float64) / 1e9)
    if types.is_duration(kind):
        return np.asarray(column.cast(pyarrow.duration("ns"), safe=False).cast(pyarrow.int64()).to_numpy() / 1e9)
    if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
        return np.asarray(column.cast(pyarrow.float64(), safe=False).to_numpy())
    if types.is_boolean(kind):
        return np.asarray(column.cast(pyarrow.uint8()).cast(pyarrow.float64()).to_numpy())
    if types.is_string(kind) or types.is_large_string(kind):
        return np.array([np.nan if cell is None else number_in(cell.strip()) for cell in column.to_pylist()])
    if types.is_dictionary(kind):
        return _numbers(column.cast(kind.value_type))
    return np.full(len(column), np.nan)
