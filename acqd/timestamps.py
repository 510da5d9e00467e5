"""Conversions between RFC 3339, Unix time and NTFS FILETIME; inside acqd a time is nanoseconds UTC."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from acqd.errors import InputError

Nanoseconds: TypeAlias = NDArray[np.int64]
SINCE_1970_S = 1e8
"""Unix times of clocks that run are larger (March 1973); smaller times count from another start."""
_FILETIME_1970 = 116_444_736_000_000_000  # 100 ns from 1601-01-01 to 1970-01-01
_FILETIME_2100 = 157_469_184_000_000_000
_OTHER_CLOCKS = {
    (_FILETIME_1970, _FILETIME_2100): "a FILETIME: name the column filetime",
    (627_667_488_000_000_000, 662_380_416_000_000_000): "ticks of .NET, 100 ns from the year 1: write RFC 3339",
}
"""Whole numbers of 1970 to 2100, and of 1990 to 2100; in ns they would be of 1973, and of 1989 to 1991."""
_LEAP_SECOND = re.compile(r"(.*T\d\d:\d\d:)60", re.DOTALL)
"""A second that clocks insert (RFC 3339, appendix D); Unix time has the next one in its place."""
_SHOWN = 30  # characters of a cell in a message
_MOST_NS = 2**63 - 2**32
_UNITS = ((1e11, 1_000_000_000), (1e14, 1_000_000), (1e17, 1_000), (1e20, 1))  # Unix s, ms, us, ns below each bound


def parse_times(path: Path, name: str, cells: Sequence[object], numbers: Sequence[int] | None = None) -> Nanoseconds:
    """Nanoseconds UTC of a column: RFC 3339, Unix s/ms/us/ns, or FILETIME if it is named so. Raises InputError.

    `numbers`: of the data rows that the cells are from, for messages; default 1, 2 ...
    """
    numbers = range(1, len(cells) + 1) if numbers is None else numbers
    empty = next((row for row, cell in zip(numbers, cells, strict=True) if cell is None or cell == ""), None)
    if empty is not None:
        raise InputError(path, f"column {name}: data row {empty} has no time")
    if name == "filetime":
        try:
            stamps = [(int(str(cell)) - _FILETIME_1970) * 100 for cell in cells]
        except ValueError as error:
            raise InputError(path, f"column {name}: {error}; expected a whole number of 100 ns") from None
        _require_times(path, name, min(stamps), max(stamps))
        return np.array(stamps, dtype=np.int64)
    if isinstance(cells[0], str) and not _is_number(cells[0]):
        stamps = [_parse_rfc3339(path, str(cell), row) for row, cell in zip(numbers, cells, strict=True)]
        _require_times(path, name, min(stamps), max(stamps))
        return np.array(stamps, dtype=np.int64)
    try:
        values = np.array(cells, dtype=np.float64).reshape(len(cells))
    except (ValueError, TypeError):
        named = [(row, str(cell)) for row, cell in zip(numbers, cells, strict=True)]
        row, text = next((each for each in named if not _is_number(each[1])), named[0])
        raise InputError(
            path, f"data row {row}: time {text[:_SHOWN]!r} is no number, as in the other rows: write all as numbers, "
            "or all as 2026-01-27T08:00:00.000Z"
        ) from None  # fmt: skip
    if not np.isfinite(values).all():
        raise InputError(path, f"column {name}: data row {numbers[int(np.argmin(np.isfinite(values)))]} has no time")
    largest = float(np.abs(values).max())
    unit = _unit_of(path, name, largest)
    _require_times(path, name, float(values.min()) * unit, float(values.max()) * unit)
    if all(isinstance(cell, int) or (unit == 1 and str(cell).strip().isdecimal()) for cell in cells):
        return np.array([int(str(cell)) for cell in cells], dtype=np.int64) * unit
    whole = np.floor(values)
    return whole.astype(np.int64) * unit + np.rint((values - whole) * unit).astype(np.int64)


def _unit_of(path: Path, name: str, largest: float) -> int:
    """Nanoseconds of the unit in which the largest time is written. Raises InputError for times of other clocks."""
    if other := next((what for (first, last), what in _OTHER_CLOCKS.items() if first < largest < last), None):
        raise InputError(path, f"column {name}: {largest:.6g} looks like {other}")
    unit = next((unit for bound, unit in _UNITS if largest < bound), None)
    if unit is None:
        raise InputError(path, f"column {name}: {largest:g} is not a Unix time in s, ms, us or ns")
    return unit


def _require_times(path: Path, name: str, first_ns: float, last_ns: float) -> None:
    """Raises InputError for nanoseconds that 64 bits do not hold: before 1678 or after 2262."""
    if first_ns < -_MOST_NS or last_ns > _MOST_NS:
        raise InputError(path, f"column {name}: holds a time outside the years 1678 to 2262")


def rfc3339(utc_ns: int, digits: int = 6) -> str:
    """UTC nanoseconds as 2021-07-13T10:15:30.123456Z (RFC 3339, section 5.6), cut after `digits` decimals."""
    seconds, ns = divmod(utc_ns, 1_000_000_000)
    if digits == 6:  # as every row has it; a format that is known is twice as fast
        return f"{_whole_second(seconds)}.{ns // 1000:06d}Z"
    return f"{_whole_second(seconds)}.{ns // 10 ** (9 - digits):0{digits}d}Z"


@lru_cache(maxsize=64)  # rows of a second follow one another
def _whole_second(unix_s: int) -> str:
    return f"{datetime.fromtimestamp(unix_s, UTC):%Y-%m-%dT%H:%M:%S}"


def rfc3339_ms(unix_s: float) -> str:
    """Unix seconds as text with milliseconds; a float of Unix seconds resolves no more than microseconds."""
    fraction, seconds = math.modf(unix_s)
    return rfc3339(int(seconds) * 1_000_000_000 + round(fraction * 1e6) * 1000, digits=3)


def filetime(utc_ns: int) -> int:
    """UTC nanoseconds as NTFS FILETIME: 100 ns since 1601-01-01 UTC (MS-DTYP 2.3.3)."""
    return utc_ns // 100 + _FILETIME_1970


def utc_ns(filetime_100ns: int) -> int:
    """NTFS FILETIME as UTC nanoseconds."""
    return (filetime_100ns - _FILETIME_1970) * 100


def unix_s(filetime_100ns: int) -> float:
    """NTFS FILETIME as Unix seconds."""
    return (filetime_100ns - _FILETIME_1970) * 1e-7


def _parse_rfc3339(path: Path, text: str, row: int) -> int:
    inserted = _LEAP_SECOND.match(text) if ":60" in text else None
    try:
        stamp = datetime.fromisoformat(text if inserted is None else _LEAP_SECOND.sub(r"\g<1>59", text))
    except ValueError:
        raise InputError(
            path,
            f"data row {row}: time {text!r:.40} is neither RFC 3339 nor a number: write 2026-01-27T08:00:00.000Z, or "
            "Unix seconds",
        ) from None
    if inserted is not None:
        stamp += timedelta(seconds=1)
    if stamp.tzinfo is None:
        stamp = stamp.replace(tzinfo=UTC)
    return round((stamp - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() * 1e6) * 1000


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
