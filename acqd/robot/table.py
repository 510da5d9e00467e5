"""Tables of numbers as robots write them: text with several separators, decimal commas, headers with `%`; Parquet."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError, UserError

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class Table:
    """The numbers of a file; a cell that is not a number is NaN."""

    header: list[str] | None
    values: Floats
    """[rows, columns]."""
    lines: NDArray[np.int64]
    """[rows] line of the file that holds each row, counted from 1; the row's number in a file without lines."""
    broken: dict[int, str] = field(default_factory=dict)
    """What is wrong with the rows (by index) that have another number of cells than the first line: all are NaN."""

    def line(self, row: int) -> int:
        """Line of the file that holds `row`."""
        return int(self.lines[row])


def read_table(path: Path, broken_share: float = 0.0) -> Table:
    """A table separated by commas, semicolons, tabs or spaces, with a header or without, or a Parquet file.

    Blank lines are skipped. Commas are decimal where semicolons, tabs or spaces separate the columns. Up to
    `broken_share` of the rows may have a wrong number of cells. Raises InputError, UserError (Parquet without pyarrow).
    """
    if path.suffix == ".parquet":
        return _read_parquet(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "no UTF-8 text"
        raise InputError(path, f"cannot be read ({reason})") from None
    # some recorders end lines with \r\r\n: one end of a line, not two
    numbered = [(k, line) for k, line in enumerate(text.replace("\r\r\n", "\n").splitlines(), 1) if line.strip()]
    if not numbered:
        raise InputError(path, "is empty")
    first = numbered[0][1].strip().lstrip("%").strip()
    separator = next((mark for mark in ";\t," if mark in first), None)
    cells = _split(first, separator)
    header = None if all(_is_number(cell, separator) for cell in cells) else cells
    rows = numbered[header is not None :]
    if not rows:
        raise InputError(path, "has no rows of numbers")
    lines = np.array([number for number, _ in rows])
    values, broken = _numbers([_split(line, separator) for _, line in rows], separator, len(cells))
    if len(broken) > broken_share * len(rows):
        row = min(broken)
        raise InputError(path, f"row {lines[row]} {broken[row]}")
    return Table(header, values, lines, broken)


def _numbers(rows: list[list[str]], separator: str | None, width: int) -> tuple[Floats, dict[int, str]]:
    """Values [rows, width], and what is wrong with rows of another width."""
    broken = {}
    for number, cells in enumerate(rows):
        if len(cells) != width:
            broken[number] = f"has {len(cells)} columns, the first line {width}; {_why(len(cells), width, separator)}"
            rows[number] = ["nan"] * width
    if separator != "," and any("," in cell for row in rows for cell in row):
        rows = [[_with_point(cell) for cell in row] for row in rows]
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, width), broken
    except ValueError:  # text in some column: cell by cell
        return np.array([[_number(cell) for cell in row] for row in rows]).reshape(-1, width), broken


def _why(count: int, width: int, separator: str | None) -> str:
    if separator == "," and count in (2 * width, 2 * width - 1):
        return "are commas decimal marks and separators at once? Separate columns by ; or write decimal points"
    return "is it cut off?"


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell


def _split(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _is_number(cell: str, separator: str | None) -> bool:
    cell = cell if separator == "," else _with_point(cell)
    return not math.isnan(_number(cell)) or cell.lower() in ("nan", "")


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def _read_parquet(path: Path) -> Table:
    """Columns of numbers and of time stamps (as Unix seconds); NaN for a column of anything else."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ModuleNotFoundError:
        raise UserError(f"{path}: Parquet needs pyarrow: install acqd[data]") from None
    try:
        table = pyarrow.parquet.read_table(path)
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
