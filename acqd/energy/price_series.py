"""A series of prices or CO2 factors from a CSV file: `time`, with its offset, and a value that holds until the next."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from acqd.energy.csv_rows import read_rows
from acqd.errors import InputError

UNITS: dict[str, Fraction] = {
    "EUR/kWh": Fraction(1), "EUR/MWh": Fraction(1, 1000), "ct/kWh": Fraction(1, 100),
    "kg/kWh": Fraction(1), "g/kWh": Fraction(1, 1000),
}  # fmt: skip
"""Factor to EUR or kg per kWh."""
_STEPS_S = (900, 1800, 3600)
_FEWEST = 4
"""Values of one step in a row: fewer are a hole, not the change of a market from hours to quarter hours."""


@dataclass(frozen=True, slots=True)
class Series:
    """Values per kWh that change at given times."""

    path: Path
    start: np.ndarray
    """[n] int64, Unix s, rising."""
    values: tuple[Fraction, ...]
    """[n] per kWh."""
    end: int
    """Unix time [s] at which the last value ends."""

    def at(self, moments: np.ndarray) -> list[Fraction]:
        """Values at Unix times [s]. Raises InputError outside of the series."""
        for outside in moments[(moments < self.start[0]) | (moments >= self.end)][:1].tolist():
            raise InputError(
                self.path, f"no value at {_shown(outside)}; the series goes from {_shown(int(self.start[0]))} to "
                f"{_shown(self.end)}: extend the file or choose another period"
            )  # fmt: skip
        return [self.values[k] for k in np.searchsorted(self.start, moments, side="right") - 1]


def read_series(path: Path, unit: str) -> Series:
    """The first two columns of a CSV file with a header (comma or semicolon). Raises InputError."""
    found, delimiter = read_rows(path)
    (_, header), *rows = found or [(1, [])]
    if not rows or len(header) < 2 or header[0].strip().lower() != "time":
        raise InputError(path, "expected a header with the columns time and price, and rows below it")
    for number, row in rows:
        if any(cell.strip() for cell in row[len(header) :]):  # 12,5 between commas
            raise InputError(path, f"line {number}: {len(row)} values, the header has {len(header)}")
    start = [_time(path, number, row) for number, row in rows]
    values = [_value(path, number, row, delimiter) * UNITS[unit] for number, row in rows]
    step_s = _steps(path, [number for number, _ in rows], start)
    return Series(path, np.array(start, dtype=np.int64), tuple(values), start[-1] + step_s)


_MOST = 100_000.0
"""EUR per MWh, g per kWh: beyond, something else was exported."""


def _time(path: Path, number: int, row: list[str]) -> int:
    try:
        moment = datetime.fromisoformat(row[0].strip())
    except ValueError:
        raise InputError(path, f"line {number}: time {row[0]!r:.40} is not like 2026-11-16T00:00+01:00") from None
    if moment.tzinfo is None:
        raise InputError(path, f"line {number}: time {row[0]!r:.40} has no offset; write +01:00 or Z after it")
    if moment.timestamp() % 60:
        raise InputError(path, f"line {number}: time {row[0]!r:.40} is not a whole minute")
    return round(moment.timestamp())


def _value(path: Path, number: int, row: list[str], delimiter: str) -> Fraction:
    if len(row) < 2:
        raise InputError(path, f"line {number}: no value")
    cell = row[1].strip()
    text = cell.replace(",", ".") if delimiter == ";" and cell.count(",") == 1 and "." not in cell else cell
    try:
        value = float(text)
    except ValueError:
        raise InputError(path, f"line {number}: value {cell!r:.40} is not a number") from None
    if not abs(value) <= _MOST:
        raise InputError(path, f"line {number}: value {cell!r:.40} is no price; expected {-_MOST:.0f} to {_MOST:.0f}")
    return Fraction(repr(value))  # as written: a float has 15 decimals of its own


def _steps(path: Path, lines: list[int], start: list[int]) -> int:
    """Length [s] of the last value; `lines` of the file have the times `start`.

    Raises InputError for times out of order, twice, or with a hole.
    """
    if len(start) == 1:
        return 3600
    steps = [later - earlier for earlier, later in pairwise(start)]
    for k, step in enumerate(steps):
        if step <= 0:
            raise InputError(path, f"line {lines[k + 1]}: time does not rise; sort the rows, and give every time once")
        if step not in _STEPS_S:
            raise InputError(
                path, f"line {lines[k + 1]}: {_shown(start[k])} is followed by {_shown(start[k + 1])}; "
                "expected 15, 30 or 60 min later: fill the hole"
            )  # fmt: skip
    runs = [(step, len(list(group))) for step, group in groupby(steps)]
    if len(runs) > 1 and (len(runs) > 2 or min(length for _, length in runs) < _FEWEST):
        usual = max(runs, key=lambda run: run[1])[0]
        odd = next(k for k, step in enumerate(steps) if step != usual)
        raise InputError(
            path, f"line {lines[odd + 1]}: {_shown(start[odd])} is followed by {_shown(start[odd + 1])} in a series of "
            f"{usual // 60} min: a hole, or values of another step"
        )  # fmt: skip
    return steps[-1]


def _shown(moment: int) -> str:
    return f"{datetime.fromtimestamp(moment, UTC):%Y-%m-%dT%H:%MZ}"
