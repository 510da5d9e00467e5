"""Tables as text, block by block: memory holds one block of lines and the numbers, however large the file is."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.quoted_cells import MOST_LINES, rejoined
from acqd.robot.labels import Texts, from_cells, from_numbers
from acqd.robot.last_line import CUT_OFF, MOST_ROWS, is_cut_off, lacks_cells

NO_ROWS = "has no rows of numbers; expected the log of a robot: names of columns, then rows of numbers"
_BLOCK_BYTES = 1 << 20
_LONGEST_LINE = 1 << 16
"""Bytes. A longer line is no row of a robot's log; without this limit, a file without line ends fills the memory."""
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_QUOTED = re.compile('"[^"]*"')
_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
"""Bytes that no text has."""
_TITLES = 20
"""Lines before the header that may be titles."""
_INVISIBLE = dict.fromkeys(map(ord, "\u200b\u2060\ufeff"))
"""Characters without width, which come with text that was copied from a page."""
_OTHER_SIGNS = re.compile(r"[+\-\u2212]?[\d.]+(?:[eEdD][+\-\u2212]?\d+)?")
_PLAIN_SIGNS = {ord("\u2212"): "-", ord("D"): "E", ord("d"): "e"}
"""The minus of typography, and Fortran's exponents of double precision."""
_LIST = re.compile(r"(?<!\w)(?:array|tensor)?[\[(]\s*(?!\d{4}-\d\d)[-+.\d]")
"""The beginning of a list of numbers in a cell, which a date in brackets is not."""
_SWITCHED = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "yes": 1.0, "no": 0.0}
"""Words for 1 and 0."""


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
    words: dict[int, Texts] = field(default_factory=dict)
    """[rows] cells of the columns (by index) that were asked for as text."""
    note: str = ""
    """What a user should know of the file: a last line that was left out."""

    def texts(self, column: int) -> Texts:
        """[rows] cells of a column as text."""
        return self.words[column] if column in self.words else from_numbers(self.values[:, column])

    def line(self, row: int) -> int:
        """Line of the file that holds `row`."""
        return int(self.lines[row])


def joined(tables: list[Table]) -> Table:
    """The rows of tables of one file, in their order."""
    if len(tables) == 1:
        return tables[0]
    broken: dict[int, str] = {}
    rows = 0
    for table in tables:
        broken |= {rows + row: reason for row, reason in table.broken.items()}
        rows += len(table.values)
    values = np.concatenate([table.values for table in tables])
    words = {column: np.concatenate([table.words[column] for table in tables]) for column in tables[0].words}
    lines = np.concatenate([table.lines for table in tables])
    return Table(tables[0].header, values, lines, broken, words, tables[-1].note)


def text_tables(path: Path, file: BinaryIO, words: Collection[str] = (), *, by_digits: bool = True) -> Iterator[Table]:
    """The rows of `file` in blocks of about 1 MB, each with the header of the file. Raises InputError.

    `path` is the file's name in messages; columns named `words` are read as text, too. A last line that is cut off is
    left out; unless `by_digits`, only missing cells show that.
    """
    layout, rows = None, False
    try:
        for numbered, ended in numbered_lines(path, file):
            if layout is None:
                numbered = _without_titles(_without_comments(numbered))
                layout = _Layout.of(numbered[0][1], words)
                if not layout.width:
                    raise InputError(path, "has no columns in its first line")
                numbered = numbered[layout.header is not None :]
                if numbered and _LIST.search(numbered[0][1]):
                    raise InputError(
                        path,
                        f"row {numbered[0][0]}: a cell holds a list; expected one number in each cell: write a "
                        "column for each joint, such as q1, q2 ...",
                    )
            whole = numbered if ended or not numbered else layout.whole(numbered, by_digits=by_digits)
            if whole:
                rows = True
                yield replace(layout.table(whole), note="" if len(whole) == len(numbered) else CUT_OFF)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "no UTF-8 text"
        raise InputError(path, f"cannot be read ({reason})") from None
    if layout is None:
        raise InputError(path, "is empty")
    if not rows:
        raise InputError(path, NO_ROWS)


def _without_comments(numbered: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Lines without the comments (#) at the beginning, but with a header among them (numpy.savetxt writes one)."""
    first = next((k for k, (_, line) in enumerate(numbered) if not line.lstrip().startswith("#")), len(numbered))
    if first in (0, len(numbered)):
        return numbered
    data, last = _Layout.of(numbered[first][1]), _Layout.of(numbered[first - 1][1])
    heads = data.header is None and last.header is not None and last.width == data.width
    return numbered[first - heads :]


def _without_titles(numbered: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Lines without titles before the header, and without the line by which Excel knows the separator."""
    if numbered[0][1].lower().startswith("sep="):
        numbered = numbered[1:] or numbered
    for skipped in range(min(_TITLES, len(numbered) - 2)):
        layouts = [_Layout.of(line) for _, line in numbered[skipped : skipped + 3]]
        head = layouts[1]
        cells = len(split(numbered[skipped][1], head.separator)) if head.separator else layouts[0].width
        if head.width < (2 if head.separator else 3) or cells >= head.width:
            continue
        if layouts[0].header is not None and layouts[1].header is not None and layouts[2].header is None:
            return numbered[skipped + 1 :] if layouts[1].width == layouts[2].width else numbered
    return numbered


def numbered_lines(path: Path, file: BinaryIO) -> Iterator[tuple[list[tuple[int, str]], bool]]:
    """Lines that are not blank with their numbers, in blocks, and whether the last line of a block has an end."""
    number, encoding = 1, "utf-8-sig"
    while block := file.read(_BLOCK_BYTES):
        if len(block) == _BLOCK_BYTES and not block.endswith(b"\n"):
            rest = file.readline(_LONGEST_LINE)
            if len(rest) == _LONGEST_LINE:
                raise InputError(path, f"has a line of more than {_LONGEST_LINE} bytes; expected rows of numbers")
            block += rest
            for _ in range(MOST_LINES):
                if block.count(b'"') % 2:  # perhaps within a cell
                    block += file.readline(_LONGEST_LINE)
        # some recorders end lines with \r\r\n: one end of a line, not two
        lines = _decoded(block, encoding).replace("\r\r\n", "\n").splitlines()
        rows = rejoined(lines) if b'"' in block else enumerate(lines)
        numbered = [(number + k, line) for k, line in rows if line.strip()]
        number, encoding = number + len(lines), "utf-8"
        if numbered:
            yield numbered, block.endswith((b"\n", b"\r"))


def _decoded(block: bytes, encoding: str) -> str:
    """Text of a block; where that is no UTF-8, in Western Europe's encoding: digits are the same in all of one byte."""
    try:
        return block.decode(encoding)
    except UnicodeDecodeError:
        if _CONTROL.search(block):
            raise
        return block.decode("cp1252", errors="replace")


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the first line separates and names the columns."""

    header: list[str] | None
    separator: str | None
    """None: white space."""
    width: int
    words: tuple[int, ...] = ()
    """Columns that are read as text, too."""

    @classmethod
    def of(cls, line: str, words: Collection[str] = ()) -> _Layout:
        first = line.translate(_INVISIBLE).strip().lstrip("%#").strip()
        bare = _QUOTED.sub("", first) or first
        separator = next((mark for mark in ";\t|," if mark in bare), None)
        cells = split(first, separator)
        named = not all(_is_number(cell, separator) for cell in cells)
        columns = tuple(k for k, cell in enumerate(cells) if cell in words) if named else ()
        return cls(cells if named else None, separator, len(cells), columns)

    def whole(self, numbered: list[tuple[int, str]], *, by_digits: bool) -> list[tuple[int, str]]:
        """Lines without the last one if that is a part of a line."""
        *others, last = [
            [self._cell(cell) for cell in split(line, self.separator)] for _, line in numbered[-1 - MOST_ROWS :]
        ]
        is_part = is_cut_off if by_digits else lacks_cells
        return numbered[:-1] if is_part(last, others) else numbered

    def table(self, numbered: list[tuple[int, str]]) -> Table:
        lines = np.array([number for number, _ in numbered])
        values = self._plain([line for _, line in numbered])
        if values is not None and not self.words:
            return Table(self.header, values, lines)
        rows = [split(line, self.separator) for _, line in numbered]
        values, broken = (values, {}) if values is not None else self._cells(rows)
        words = {k: from_cells([self._cell(row[k]) for row in rows]) for k in self.words}
        return Table(self.header, values, lines, broken, words)

    def _plain(self, lines: list[str]) -> Floats | None:
        """[rows, width] of lines that hold nothing but numbers; None if a cell is anything else."""
        try:
            values = np.loadtxt(lines, delimiter=self.separator, comments=None, ndmin=2)
        except (ValueError, OverflowError):
            return None
        return values if values.shape == (len(lines), self.width) else None

    def _cells(self, rows: list[list[str]]) -> tuple[Floats, dict[int, str]]:
        """Values [rows, width] cell by cell, and what is wrong with rows of another width."""
        broken = {}
        for number, cells in enumerate(rows):
            if len(cells) == self.width + 1 and not cells[-1]:  # a separator at the end of each row
                rows[number] = cells[:-1]
        widths, counts = np.unique([len(cells) for cells in rows], return_counts=True)
        usual = int(widths[counts.argmax()]) if counts.max() > len(rows) / 2 else self.width
        for number, cells in enumerate(rows):
            if len(cells) != self.width:
                broken[number] = (
                    f"has {len(cells)} columns, the first line {self.width}; {self._why_width(len(cells), usual)}"
                )
                rows[number] = ["nan"] * self.width
        if self.separator != "," and any("," in cell for row in rows for cell in row):
            rows = [[self._cell(cell) for cell in row] for row in rows]
        return np.array([[number_in(cell) for cell in row] for row in rows]).reshape(-1, self.width), broken

    def _cell(self, cell: str) -> str:
        return cell if self.separator == "," else _with_point(cell)

    def _why_width(self, count: int, usual: int) -> str:
        """What may be wrong with a row of `count` cells, where most rows have `usual`."""
        if self.separator == "," and count in (2 * self.width, 2 * self.width - 1):
            return "are commas decimal marks and separators at once? Separate columns by ; or write decimal points"
        if usual == self.width + 1 and self.header is not None:
            return "is a column without a name, as R's row names? Name it in the first line"
        if usual != self.width:
            return f"most rows {usual}: expected a line with the names of {usual} columns before the rows"
        return "is it cut off?"


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell


def split(line: str, separator: str | None) -> list[str]:
    """The cells of a line, without their quotes; separators between quotes belong to a cell."""
    cells = line.split(separator)
    if separator and '"' in line and line.count('"') % 2 == 0:
        quoted = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        cells = quoted if len(quoted) > 1 else cells  # a whole line in quotes
    return [cell.strip().strip('"') for cell in cells]


def _is_number(cell: str, separator: str | None) -> bool:
    cell = cell if separator == "," else _with_point(cell)
    return not math.isnan(number_in(cell)) or cell.lower() in ("nan", "")


def number_in(cell: str) -> float:
    """The number in a cell, 1 or 0 for a word, Unix seconds of a date with a time (UTC without a zone), or NaN."""
    try:
        return float(cell)
    except ValueError:
        pass
    if cell.lower() in _SWITCHED:
        return _SWITCHED[cell.lower()]
    if not _DATE.match(cell):
        plain = cell.translate(_PLAIN_SIGNS)
        return number_in(plain) if plain != cell and _OTHER_SIGNS.fullmatch(cell) else float("nan")
    try:
        moment = datetime.fromisoformat(cell)
    except ValueError:
        return float("nan")
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
