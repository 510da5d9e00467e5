"""What a device was working on, from a CSV file of a production system: a value holds until the next line."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from acqd.energy.csv_rows import read_rows
from acqd.errors import InputError, UserError

KINDS = ("program", "step", "part", "state")
_TICKS = 10_000_000


@dataclass(frozen=True, slots=True)
class Marks:
    """Values of one device."""

    ticks: np.ndarray
    """[n] int64, 100 ns since 1970, rising: from when each value holds."""
    names: tuple[str, ...]
    """[n]; empty: nothing is worked on."""


def read_marks(path: Path, kind: str) -> dict[str, Marks]:
    """Marks by device, or under "" where the file has no column of that name. Raises InputError, UserError.

    A line that repeats the value of the one before is no mark: a file of parts and steps has a line for every step.
    """
    rows, _ = read_rows(path)
    header = [name.strip().lower() for name in rows[0][1]] if rows else []
    for name in ("time", kind):
        if name not in header:
            raise InputError(path, f"has no column {name}; expected a header with time, {kind} and perhaps device")
    if twice := [name for name in ("time", kind, "device") if header.count(name) > 1]:
        raise InputError(path, f"has two columns {twice[0]}; remove one")
    place = {name: header.index(name) for name in ("time", kind, "device") if name in header}
    found: dict[str, list[tuple[int, str]]] = {}
    latest: dict[str, int] = {}
    for number, row in rows[1:]:
        if len(row) != len(header):
            raise InputError(path, f"line {number}: {len(row)} values, expected {len(header)}")
        device = row[place["device"]].strip() if "device" in place else ""
        of = found.setdefault(device, [])
        ticks = ticks_of(path, number, row[place["time"]])
        if device in latest and ticks <= latest[device]:
            raise InputError(path, f"line {number}: time does not rise; sort the rows, and give every time once")
        latest[device], value = ticks, row[place[kind]].strip()
        if value != (of[-1][1] if of else ""):
            of.append((ticks, value))
    if not found:
        raise UserError(f"{path}: has no lines below the header")
    return {
        device: Marks(np.array([ticks for ticks, _ in of], dtype=np.int64), tuple(name for _, name in of))
        for device, of in found.items()
    }


def ticks_of(path: Path, number: int, text: str) -> int:
    """100 ns since 1970 of a time with an offset. Raises InputError, naming the line."""
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        raise InputError(path, f"line {number}: time {text!r:.40} is not like 2026-11-16T06:00:01.5+01:00") from None
    if moment.tzinfo is None:
        raise InputError(path, f"line {number}: time {text!r:.40} has no offset; write +01:00 or Z after it")
    return int(moment.timestamp()) * _TICKS + moment.microsecond * 10
