"""The rows of a text export as numbers."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from itertools import islice

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.text.clock import read_stamp
from acqd.sources.text.layout import Layout
from acqd.sources.text.lines import Text
from acqd.sources.text.table import Table, is_number, split_row


class Rows:
    """The rows of one table, whose columns are read when they are asked for."""

    def __init__(self, text: Text, layout: Layout, table: Table, head: list[str]) -> None:
        self.text, self.layout, self.table, self.head = text, layout, table, head
        self._columns: dict[int, Floats] = {}
        if self._begins(head[table.first]):
            text.leave_out(self._begins)

    def _begins(self, line: str) -> bool:
        """Whether a line begins with a number or a stamp, as rows do."""
        first = next((field for field in self.split(line) if field), "")
        return is_number(first, self.table.decimal) or read_stamp(first) is not None

    def first_fields(self) -> list[str]:
        """The fields of the first row."""
        fields = self.split(self.head[self.table.first])
        return [*fields, *[""] * (self.table.width - len(fields))]

    def split(self, line: str) -> list[str]:
        """Fields of the table in a line."""
        fields = split_row(line, self.table.separator)
        if self.layout.columns:
            fields = [fields[k] if k < len(fields) else "" for k in self.layout.columns]
        return fields

    def fields(self) -> Iterator[tuple[int, list[str]]]:
        """Number of each row in the file, from 1, and its fields."""
        for number, line in enumerate(self.text.lines(), start=1):
            if number > self.table.first and line.strip():
                yield number, self.split(line)

    def numbers(self, column: int) -> Floats:
        """The numbers of a column. Raises InputError, which names row and column of anything else."""
        if column not in self._columns:
            self.load([column])
        return self._columns[column]

    def forget(self, column: int) -> None:
        """Give the memory of a column back."""
        self._columns.pop(column, None)

    def load(self, columns: list[int]) -> None:
        """Read some columns at once. Raises InputError, which names row and column of anything else."""
        places = [self.layout.columns[k] for k in columns] if self.layout.columns else columns
        delimiter = {" ": None, ",": ";" if self._quoted else ","}.get(self.table.separator, self.table.separator)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that there are no rows
                found = np.loadtxt(self._rows(), delimiter=delimiter, usecols=places, ndmin=2, comments=None)
        except (ValueError, IndexError):
            fault = self._first_fault(columns)
            if self._columns or self.text.torn or not self.text.ends_torn():  # columns have equally many rows
                raise InputError(self.text.path, fault) from None
            self.text.torn = True  # a logger that lost its supply
            try:
                self.load(columns)
            except InputError:
                raise InputError(self.text.path, fault) from None
            return
        bad = np.argwhere(~np.isfinite(found))
        if len(bad):
            row, column = bad[0]
            raise InputError(
                self.text.path,
                f"row {row + self.table.first + 1}, column {columns[column] + 1}: {found[row, column]} is not a number",
            )
        for k, column in enumerate(columns):
            self._columns[column] = found[:, k]

    @property
    def _quoted(self) -> bool:
        """Whether quotes alone tell decimal commas from separators."""
        return self.table.separator == self.table.decimal

    def _rows(self) -> Iterator[str]:
        comma = self.table.decimal == ","
        for line in islice(self.text.lines(), self.table.first, None):
            if line.strip():
                if self._quoted:
                    line = ";".join(split_row(line, self.table.separator))
                row = line.replace('"', "")
                yield row.replace(",", ".") if comma else row

    def _first_fault(self, columns: list[int]) -> str:
        """Which row and column is not as the first rows promise."""
        for number, fields in self.fields():
            if len(fields) < max(columns) + 1 or (fields and not any(fields)):
                return (
                    f"row {number} has {len(fields)} columns, expected {self.table.width} as in the header (cut off?)"
                )
            for k in columns:
                if "∞" in fields[k]:
                    return f"row {number}, column {k + 1}: {fields[k]!r} is beyond the range of the instrument"
                if not is_number(fields[k], self.table.decimal):
                    sign = " (decimal sign?)" if any(c in fields[k] for c in ".,") else ""
                    return f"row {number}, column {k + 1}: {fields[k]!r} is not a number{sign}"
        return "is not a table of numbers"

    def quantum(self, column: int) -> float:
        """Step in which a column of times is printed, from the first rows."""
        digits = 0
        for line in self.head[self.table.first : self.table.first + 100]:
            fields = self.split(line)
            if column < len(fields):
                mantissa, _, exponent = fields[column].lower().partition("e")
                places = len(mantissa.replace(",", ".").partition(".")[2])
                digits = max(digits, places - (int(exponent) if exponent.lstrip("+-").isdigit() else 0))
        return 10.0**-digits
