"""Reads power rows from CSV, JSON lines and Parquet files."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import orjson
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from acqd.dataset.power_source import BLOCK_ROWS, PowerRows, choose
from acqd.dataset.schema import UTC_NS
from acqd.errors import InputError, UserError
from acqd.parquet_size import check_size
from acqd.robot.last_line import LEFT_OUT, MOST_ROWS, is_cut_off
from acqd.robot.table import text_of
from acqd.robot.table_text import split
from acqd.timestamps import Nanoseconds, parse_times

_ZONE = re.compile(r"(?:Z|[+-]\d\d:?(?:\d\d)?)$", re.IGNORECASE)
"""At the end of a time of RFC 3339 with a zone."""
_SHOWN = 20
"""Characters of a cell in a message."""
_MISFIT = re.compile(r"Row #(?P<number>\d+): Expected (?P<expected>\d+) columns, got (?P<actual>\d+)")
"""In pyarrow's errors. Its handler of such rows cannot read those that are no UTF-8, and prints a traceback."""
_READ = pyarrow.csv.ReadOptions(use_threads=False)
"""With threads, rows have no numbers."""
_BOM = b"\xef\xbb\xbf"
_FIRST = re.compile(rb"[^\r\n]*(?:\r\n|\r|\n)?")
"""A line with its end."""
_LONGEST_LINE = 1 << 16
"""Bytes of the end of a file that hold its last line."""
if TYPE_CHECKING:
    from _typeshed import WriteableBuffer
Reader = Callable[[Path, list[str]], Iterator[pa.RecordBatch]]
"""Batches of a file; what a user should know is added to the list."""


def read_file(path: Path, device: str | None, channel: str | None, notes: list[str]) -> Iterator[PowerRows]:
    """Rows of one device and channel; columns time (or filetime) and P, and device, channel, Vrms, flags if present.

    What a user should know is added to `notes`. Raises UserError, InputError.
    """
    if not path.is_file():
        raise InputError(path, "no such file")
    try:
        yield from _rows(path, _READERS[path.suffix], device, channel, notes)
    except UserError:
        raise
    except PermissionError:
        raise InputError(path, "may not be read by this user; check its permissions") from None
    except Exception as error:  # names and cells that are no text, types that a column cannot have ...
        raise InputError(path, f"cannot be read as power rows ({type(error).__name__}: {error})") from None


def _rows(path: Path, reader: Reader, device: str | None, channel: str | None, notes: list[str]) -> Iterator[PowerRows]:
    present: set[tuple[str, str]] = set()
    for table in reader(path, []):  # the first pass finds what there is to choose from
        present |= set(zip(*_devices_and_channels(table), strict=True))
    chosen = choose(str(path), present, device, channel)
    before = 0
    for table in reader(path, notes):
        rows = [k for k, pair in enumerate(zip(*_devices_and_channels(table), strict=True)) if pair == chosen]
        clock = _clock_column(path, table.schema.names)
        if rows:
            yield _power_rows(path, table, clock, rows, before)
        before += len(table)


def parquet_batches(path: Path, _notes: list[str]) -> Iterator[pa.RecordBatch]:
    """Batches of a Parquet file. Raises InputError."""
    try:
        with pyarrow.parquet.ParquetFile(path) as parquet:
            check_size(path, parquet.metadata)
            yield from parquet.iter_batches(BLOCK_ROWS)
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(path, f"is not a Parquet file ({str(error).splitlines()[0]})") from None


def csv_batches(path: Path, notes: list[str]) -> Iterator[pa.RecordBatch]:
    """Batches of a CSV file; with semicolons, its numbers have decimal commas or points. Raises InputError.

    A last line that is cut off, as that of a recorder which was stopped hard, is no row; a note says so.
    """
    with path.open("rb") as raw:
        file = text_of(path, raw)
        start, head = _header(path, file)
        mark = _separator(head)
        parse = pyarrow.csv.ParseOptions(delimiter=mark)
        convert = pyarrow.csv.ConvertOptions(decimal_point="," if mark == ";" else ".")
        end = _end_of_whole_lines(file, start + len(head), mark)
        whole = _Part(file, start, end)
        try:
            yield from pyarrow.csv.open_csv(whole, read_options=_READ, parse_options=parse, convert_options=convert)
        except pa.ArrowInvalid as error:
            raise InputError(path, _misfit(str(error))) from None
        if end < file.seek(0, os.SEEK_END):
            notes.append(_cut_off(path))


def _cut_off(path: Path) -> str:
    return f"power {path}: {LEFT_OUT}"


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
    if not head:
        raise InputError(path, "has no rows; expected a header with the columns time (or filetime) and P")
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
    return split(line.decode(errors="replace"), mark)


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


def _misfit(message: str) -> str:
    """What to say of an error of pyarrow."""
    row = _MISFIT.search(message)
    return (
        message.splitlines()[0]
        if row is None
        else (
            f"row {row['number']} has {row['actual']} columns, the header {row['expected']}: is it cut off, or are "
            "commas decimal marks and separators at once? Remove it, or separate columns by ;"
        )
    )


def json_line_batches(path: Path, notes: list[str]) -> Iterator[pa.RecordBatch]:
    """Batches of a file with one JSON object a line, or blank lines. Raises InputError.

    A last line that is cut off is no row; a note says so.
    """
    rows: list[dict[str, object]] = []
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
            rows.append(row)
            if len(rows) == BLOCK_ROWS:
                yield _batch(path, rows, number)
                rows = []
    if rows:
        yield _batch(path, rows, number)


def _batch(path: Path, rows: list[dict[str, object]], last: int) -> pa.RecordBatch:
    try:
        return pa.RecordBatch.from_pylist(rows)
    except (pa.ArrowInvalid, pa.ArrowTypeError) as error:
        lines = f"lines {last - len(rows) + 1} to {last}"
        raise InputError(path, f"{lines}: a column changes its type ({str(error).splitlines()[0]})") from None


def _devices_and_channels(table: pa.RecordBatch) -> tuple[list[str], list[str]]:
    """Device and channel of each row; empty texts where a file has no such column."""
    names = table.schema.names
    device, channel = (
        table.column(name).to_pylist() if name in names else [""] * len(table) for name in ("device", "channel")
    )
    return device, channel


def _clock_column(path: Path, names: list[str]) -> str:
    clock = next((name for name in ("filetime", "time") if name in names), None)
    if clock is None or "P" not in names:
        raise InputError(path, f"needs the columns time (or filetime) and P; it has {', '.join(names[:8])}")
    return clock


def _power_rows(path: Path, table: pa.RecordBatch, clock: str, rows: list[int], before: int) -> PowerRows:
    """The `rows` of a batch; `before` it, the file has so many data rows."""
    data = table.to_pydict()
    volts = data.get("Vrms", [None] * len(table))
    flags = [_flag_names(data["flags"][k]) for k in rows] if "flags" in data else [()] * len(rows)
    column = table.column(clock).take(pa.array(rows))
    numbers = [before + k + 1 for k in rows]
    stamps, local = _stamps(path, column, clock, numbers), _without_zone(column)
    P = [_number(path, "P", data["P"][k], before + k + 1) for k in rows]
    Vrms = [_number(path, "Vrms", volts[k], before + k + 1) for k in rows]
    try:
        return PowerRows.of(stamps, P, Vrms, flags, without_zone=local)
    except ValueError as error:
        raise InputError(path, f"column P or Vrms: {error}") from None


def _stamps(path: Path, column: pa.Array, name: str, numbers: list[int]) -> Nanoseconds:
    """Nanoseconds UTC of the data rows `numbers`; timestamps with a zone are taken as they are. Raises InputError."""
    if pa.types.is_timestamp(column.type) and column.type.tz is not None and not column.null_count:
        return np.asarray(column.cast(UTC_NS).cast(pa.int64()).to_numpy())
    return parse_times(path, name, [_timestamp(cell) for cell in column.to_pylist()], numbers)


def _without_zone(column: pa.Array) -> bool:
    """Whether times are written as on a wall clock, without a zone."""
    if pa.types.is_timestamp(column.type):
        return column.type.tz is None
    first = column[0].as_py()
    return isinstance(first, str) and ":" in first and not _ZONE.search(first.strip())


def _timestamp(cell: object) -> object:
    return cell.isoformat() if hasattr(cell, "isoformat") else cell


def _number(path: Path, column: str, cell: object, row: int) -> float:
    """The number in a cell; NaN in an empty one. Raises InputError for text."""
    try:
        return float("nan") if cell is None or cell == "" else float(cell)  # type: ignore[arg-type]
    except ValueError:
        text = str(cell)[:_SHOWN]
        raise InputError(
            path,
            f"data row {row}: column {column} holds {text!r}: expected numbers without units, and empty cells for "
            "missing values",
        ) from None


def _flag_names(cell: object) -> tuple[str, ...]:
    if isinstance(cell, str):
        return tuple(re.findall(r"\w+", cell))  # a JSON list, or words
    return tuple(cell or ())  # type: ignore[arg-type]


_READERS: dict[str, Reader] = {
    ".parquet": parquet_batches,
    **dict.fromkeys((".jsonl", ".json", ".ndjson"), json_line_batches),
    **dict.fromkeys((".csv", ".txt"), csv_batches),
}
