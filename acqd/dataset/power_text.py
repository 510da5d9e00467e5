"""Power rows of CSV files and of JSON lines, block by block."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import orjson

from acqd.dataset.power_cells import COLUMNS, Cells, clock_column
from acqd.dataset.power_source import BLOCK_ROWS
from acqd.errors import InputError
from acqd.quoted_cells import MOST_LINES, ends_in_cell
from acqd.robot.last_line import LEFT_OUT, MOST_ROWS, is_cut_off
from acqd.robot.table import text_of
from acqd.robot.table_text import numbered_lines, split

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer
_BOM = b"\xef\xbb\xbf"
_FIRST = re.compile(rb"[^\r\n]*(?:\r\n|\r|\n)?")
"""A line with its end."""
_LONGEST_LINE = 1 << 16
"""Bytes of the end of a file that hold its last line."""
_WITH_DECIMALS = ("filetime", "time", "P", "Vrms")


def csv_cells(path: Path, notes: list[str]) -> Iterator[Cells]:
    """Blocks of a CSV file; with semicolons, its numbers have decimal commas or points. Raises InputError.

    A last line that is cut off, as that of a recorder which was stopped hard, is no row; a note says so.
    """
    with path.open("rb") as raw:
        file = text_of(path, raw)
        start, head = _header(path, file)
        mark = _separator(head)
        first = start + len(head)
        end = _end_of_whole_lines(file, first, mark)
        file.seek(0)
        line = len(_FIRST.findall(file.read(first)))  # the last match is empty: the number of the first line of rows
        rows = io.BufferedReader(_Part(file, first, end))
        try:
            yield from _csv_blocks(path, rows, _cells(head, mark), mark, line)
        except UnicodeDecodeError:
            raise InputError(path, "cannot be read (no UTF-8 text)") from None
        if end < file.seek(0, os.SEEK_END):
            notes.append(_cut_off(path))


def _csv_blocks(path: Path, file: BinaryIO, names: list[str], mark: str, first_line: int) -> Iterator[Cells]:
    """Rows of `file`, which begins with the line `first_line` of the file `path`."""
    clock = clock_column(path, names)
    chosen = [name for name in COLUMNS if name in names]
    pick = itemgetter(*(names.index(name) for name in chosen))
    rows: list[tuple[str, ...]] = []
    before = 0
    for numbered, _ in numbered_lines(path, file):
        for number, line in numbered:
            cells = split(line, mark) if '"' in line else line.split(mark)
            if len(cells) != len(names):
                raise InputError(path, _misfit(first_line + number - 1, len(cells), len(names)))
            rows.append(pick(cells))
        if len(rows) >= BLOCK_ROWS:
            yield _block(rows, chosen, mark, clock, before)
            before += len(rows)
            rows = []
    if rows:
        yield _block(rows, chosen, mark, clock, before)


def _block(rows: list[tuple[str, ...]], names: list[str], mark: str, clock: str, before: int) -> Cells:
    columns: dict[str, Sequence[object]] = {
        name: [_with_point(cell.strip()) for cell in cells]
        if mark == ";" and name in _WITH_DECIMALS
        else [cell.strip() for cell in cells]
        for name, cells in zip(names, zip(*rows, strict=True), strict=True)
    }
    return Cells(clock, columns, len(rows), before)


def _with_point(cell: str) -> str:
    """A cell with a decimal point; one with separators of thousands as it is, so that its message shows it so."""
    return cell if "." in cell else cell.replace(",", ".")


def _cut_off(path: Path) -> str:
    return f"power {path}: {LEFT_OUT}"


def _misfit(line: int, actual: int, expected: int) -> str:
    return (
        f"row {line} has {actual} columns, the header {expected}: is it cut off, or are "
        "commas decimal marks and separators at once? Remove it, or separate columns by ;"
    )


def _header(path: Path, file: BinaryIO) -> tuple[int, bytes]:
    """Where the header begins, and the header.

    Blank lines, comments (#) and the line by which Excel knows the separator are no header. Raises InputError where
    the file has no header, or where the header is a comment.
    """
    start = len(_BOM) if file.read(len(_BOM)) == _BOM else 0
    comment, head = b"", _line_at(file, start)
    while head and (not head.strip() or head.startswith(b"#") or head.lower().startswith(b"sep=")):
        comment = head if head.strip() else comment
        start += len(head)
        head = _line_at(file, start)
    for _ in range(MOST_LINES):
        if ends_in_cell(head.decode(errors="replace").rstrip("\r\n")):
            head += _line_at(file, start + len(head))
    if not head:
        raise InputError(path, "has no rows; expected a header with the columns time (or filetime) and P")
    if any(byte < ord("\t") or ord("\r") < byte < ord(" ") for byte in head):
        raise InputError(path, "is no text; expected CSV with the columns time (or filetime) and P")
    names = _cells(comment.lstrip(b"#"), _separator(head))
    clock = {"time", "filetime"} & set(names)
    cells = _cells(head, _separator(head))
    if clock and "P" in names and "P" not in cells and len(names) == len(cells):
        raise InputError(path, "its header is a comment: remove the # before the names of the columns")
    return start, head


def _line_at(file: BinaryIO, start: int) -> bytes:
    file.seek(start)
    line = _FIRST.match(file.readline(_LONGEST_LINE))
    return line[0] if line else b""


def _separator(head: bytes) -> str:
    return next((mark for mark in (";", "\t") if mark.encode() in head and b"," not in head), ",")


def _cells(line: bytes, mark: str) -> list[str]:
    return split(" ".join(line.decode(errors="replace").splitlines()), mark)


class _Part(io.RawIOBase):
    """The bytes of a file from `start` up to `end`."""

    def __init__(self, file: BinaryIO, start: int, end: int) -> None:
        file.seek(start)
        self._file, self._left = file, end - start

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: WriteableBuffer) -> int:
        place = memoryview(buffer)
        read = self._file.read(min(len(place), self._left))
        place[: len(read)] = read
        self._left -= len(read)
        return len(read)


def _end_of_whole_lines(file: BinaryIO, begin: int, mark: str) -> int:
    """Bytes before a last line that has no end and is a part of a line; of any other file, all.

    Rows begin at `begin`.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(max(begin, size - _LONGEST_LINE))
    text = file.read()
    last = text[max(text.rfind(b"\n"), text.rfind(b"\r")) + 1 :]
    if not last or len(last) == len(text):  # ended; one row only, or longer than any row
        return size
    lines = text[: len(text) - len(last)].splitlines()
    lines = lines if size - begin <= _LONGEST_LINE else lines[1:]  # without the rest of a line
    others = [_row(line, mark) for line in lines[-MOST_ROWS:] if line.strip()]
    in_quotes = last.count(b'"') % 2 == 1 and not any(line.count(b'"') % 2 for line in lines)
    return size - len(last) if in_quotes or is_cut_off(_row(last, mark), others) else size


def _row(line: bytes, mark: str) -> list[str]:
    """Cells; with semicolons, decimal commas as points."""
    return [cell.replace(",", ".") if mark == ";" else cell for cell in _cells(line, mark)]


def json_line_cells(path: Path, notes: list[str]) -> Iterator[Cells]:
    """Blocks of a file with one JSON object a line, or blank lines. Raises InputError.

    A last line that is cut off is no row; a note says so.
    """
    rows: list[dict[str, Any]] = []
    before, clock = 0, ""
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not line.strip(b"\0 \t\r\n"):  # zeros: the file system had kept room for more
                continue
            try:
                row = orjson.loads(line)
            except orjson.JSONDecodeError as error:
                if number > 1 and not line.endswith(b"\n"):
                    notes.append(_cut_off(path))
                    break
                raise InputError(path, f"line {number} is not JSON ({error})") from None
            if not isinstance(row, dict):
                raise InputError(path, f"line {number} is not a JSON object with time and P")
            clock = clock or clock_column(path, list(row))
            rows.append(row)
            if len(rows) == BLOCK_ROWS:
                yield _json_block(rows, clock, before)
                before += len(rows)
                rows = []
    if rows:
        yield _json_block(rows, clock, before)


def _json_block(rows: list[dict[str, Any]], clock: str, before: int) -> Cells:
    # device and channel always: a later row may be the first that names them
    names = [name for name in COLUMNS if name in ("device", "channel") or any(name in row for row in rows)]
    return Cells(clock, {name: [row.get(name) for row in rows] for name in names}, len(rows), before)
