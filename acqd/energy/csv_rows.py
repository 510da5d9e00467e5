"""Rows of a CSV file with comma or semicolon, as spreadsheets write them."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from acqd.errors import InputError


def read_rows(path: Path) -> tuple[list[tuple[int, list[str]]], str]:
    """Line and fields of the rows that are not empty, and the delimiter. Raises InputError."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None
    delimiter = ";" if ";" in text.partition("\n")[0] else ","
    try:
        reader = csv.reader(io.StringIO(text), delimiter=delimiter)
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise InputError(path, f"is no table of values ({error})") from None
    return rows, delimiter
