"""Text tables as robots write them: several separators, headers with `%`, columns of text."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError


@dataclass(frozen=True, slots=True)
class Table:
    """The numbers of a file; a cell that is not a number is NaN."""

    header: list[str] | None
    values: Floats
    """[rows, columns]."""
    first_line: int
    """Line number of the first row."""

    def line(self, row: int) -> int:
        """Line of the file that holds `row`."""
        return self.first_line + row


def read_table(path: Path) -> Table:
    """A table separated by commas, semicolons, tabs or spaces, with a header or without. Raises InputError."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "no UTF-8 text"
        raise InputError(path, f"cannot be read ({reason})") from None
    lines = text.splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    blank = next((k for k, line in enumerate(lines) if line.strip()), len(lines))
    if blank == len(lines):
        raise InputError(path, "is empty")
    first = lines[blank].strip().lstrip("%").strip()
    separator = next((mark for mark in ",;\t" if mark in first), None)
    cells = _split(first, separator)
    header = None if all(_is_number(cell) for cell in cells) else cells
    start = blank + (header is not None)
    values = _numbers(path, lines[start:], separator, len(cells), start + 1)
    if not len(values):
        raise InputError(path, "has no rows of numbers")
    if separator == ";" and "," in lines[start] and np.isnan(values[0]).any():
        raise InputError(path, f"row {start + 1} has decimal commas; write decimal points")
    return Table(header, values, start + 1)


def _numbers(path: Path, lines: list[str], separator: str | None, width: int, first_line: int) -> Floats:
    rows = []
    for number, line in enumerate(lines, start=first_line):
        cells = _split(line, separator)
        if len(cells) != width:
            raise InputError(path, f"row {number} has {len(cells)} columns, the first line {width}; is it cut off?")
        rows.append(cells)
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, width)
    except ValueError:  # text in some column: cell by cell
        return np.array([[_number(cell) for cell in row] for row in rows]).reshape(-1, width)


def _split(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _is_number(cell: str) -> bool:
    return not math.isnan(_number(cell)) or cell.lower() in ("nan", "")


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")
