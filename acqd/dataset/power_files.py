"""Reads power rows from CSV, JSON lines and Parquet files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from acqd.dataset.power_cells import Cells, Reader
from acqd.dataset.power_source import PowerRows, choose
from acqd.dataset.power_text import csv_cells, json_line_cells
from acqd.errors import InputError, UserError
from acqd.extras import require
from acqd.robot.table import foreign_format
from acqd.timestamps import parse_times

_ZONE = re.compile(r"(?:Z|[+-]\d\d:?(?:\d\d)?)$", re.IGNORECASE)
"""At the end of a time of RFC 3339 with a zone."""
_HEAD = 64
_SHOWN = 20
"""Characters of a cell in a message."""
_MISSING = frozenset({"", "#n/a", "#n/a n/a", "#na", "n/a", "na", "null", "1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan"})
"""What programs write where a value is missing, in lower case; `nan` is a number."""


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


def known_format(path: Path) -> str:
    """What a file is that is no table of text, and what to do; empty for a table, and without a file to read."""
    try:
        with path.open("rb") as file:
            return foreign_format(file.read(_HEAD))
    except OSError:
        return ""


def _rows(path: Path, reader: Reader, device: str | None, channel: str | None, notes: list[str]) -> Iterator[PowerRows]:
    present: set[tuple[str, str]] = set()
    for cells in reader(path, []):  # the first pass finds what there is to choose from
        present |= set(zip(*_devices_and_channels(cells), strict=True))
        if not {"device", "channel"} & cells.columns.keys():
            break
    chosen = choose(str(path), present, device, channel)
    for cells in reader(path, notes):
        pairs = zip(*_devices_and_channels(cells), strict=True)
        rows = [k for k, pair in enumerate(pairs) if pair == chosen]
        if rows:
            yield _power_rows(path, cells, rows)


def _parquet(path: Path, notes: list[str]) -> Iterator[Cells]:
    require(f"{path}: Parquet", ("pyarrow",), "parquet")
    from acqd.dataset.power_parquet import parquet_cells

    return parquet_cells(path, notes)


def _devices_and_channels(cells: Cells) -> tuple[list[str], list[str]]:
    """Device and channel of each row; empty texts where a file has no such column."""
    device, channel = (
        [str("" if cell is None else cell) for cell in cells.columns.get(name, [""] * cells.count)]
        for name in ("device", "channel")
    )
    return device, channel


def _power_rows(path: Path, cells: Cells, rows: list[int]) -> PowerRows:
    """The `rows` of a block."""
    numbers = [cells.before + k + 1 for k in rows]

    def column(name: str) -> list[object]:
        values = cells.columns.get(name)
        return [None] * len(rows) if values is None else [values[k] for k in rows]

    times = column(cells.clock)
    stamps = parse_times(path, cells.clock, times, numbers) if cells.time_ns is None else cells.time_ns[rows]
    P, Vrms = (
        [_number(path, name, cell, number) for cell, number in zip(column(name), numbers, strict=True)]
        for name in ("P", "Vrms")
    )
    flags = [_flag_names(cell) for cell in column("flags")]
    without_zone = cells.time_ns is None and _without_zone(path, times, numbers)
    return PowerRows.of(stamps, P, Vrms, flags, without_zone=without_zone)


def _without_zone(path: Path, times: Sequence[object], numbers: Sequence[int]) -> bool:
    """Whether times are written as on a wall clock, without a zone. Raises InputError where only some are."""
    first = times[0]
    if not isinstance(first, str) or ":" not in first:
        return False
    without = [not _ZONE.search(str(time).strip()) for time in times]
    other = next((number for number, each in zip(numbers, without, strict=True) if each != without[0]), None)
    if other is not None:
        this, before = ("a zone", "none") if without[0] else ("no zone", "one")
        raise InputError(
            path, f"data row {other}: its time has {this}, those of the rows before have {before}: write the zone (Z, "
            "+01:00) in every row"
        )  # fmt: skip
    return without[0]


def _number(path: Path, column: str, cell: object, row: int) -> float:
    """The number in a cell; NaN in an empty one. Raises InputError for text."""
    if cell is None:
        return float("nan")
    try:
        return float(cell)  # type: ignore[arg-type]
    except (ValueError, TypeError):
        text = str(cell)
    if text.strip().lower() in _MISSING:
        return float("nan")
    raise InputError(
        path,
        f"data row {row}: column {column} holds {text[:_SHOWN]!r}: expected numbers without units, and empty cells for "
        "missing values",
    )


def _flag_names(cell: object) -> tuple[str, ...]:
    if not cell:
        return ()
    if isinstance(cell, str):
        return tuple(re.findall(r"\w+", cell))  # a JSON list, or words
    return tuple(cell)  # type: ignore[arg-type]


_READERS: dict[str, Reader] = {
    ".parquet": _parquet,
    **dict.fromkeys((".jsonl", ".json", ".ndjson"), json_line_cells),
    **dict.fromkeys((".csv", ".txt"), csv_cells),
}
