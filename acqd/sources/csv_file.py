"""CSV recordings: a header, then one row per sample; voltages in V, currents in A, time in s."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.waveform import LATEST_NS, ChannelMap, Waveform, quantise

_TIME = ("time", "t", "t_s", "time_s", "seconds")
_ALIASES = {"u": "u1", "v": "u1", "v1": "u1", "v2": "u2", "v3": "u3", "i": "i1"}
_JITTER = 0.01  # of one period: a larger deviation is not an equidistant recording
_UNIX = 1e8  # a time column beyond this counts from 1970, below it from the recording's start


def load(path: Path, channels: ChannelMap) -> Waveform:
    """Columns by name (`time,u1,i1,u2,i2,u3,i3`) or by --map. Raises InputError."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(path, "is not text; expected CSV with a header row") from None
    if not lines:
        raise InputError(path, "is empty")
    delimiter = next((d for d in ";\t," if d in lines[0]), ",")
    header = [name.strip().strip('"') for name in lines[0].split(delimiter)]
    if all(_is_number(name) for name in header):
        raise InputError(path, "row 1 has no names; expected a header like time,u1,i1")
    found = _find(header)
    pairs = channels.pairs(path, found)
    order = [_column(path, header, name) for pair in pairs for name in pair]
    table = _table(path, lines, delimiter, len(header))
    if not len(table):
        raise InputError(path, "has a header but no samples")
    clock = [k for k, name in enumerate(header) if name.lower() in _TIME]
    rate, start = _clock(path, table[:, clock[0]], channels) if clock else (channels.rate, None)
    if rate is None:
        raise InputError(path, "has no time column; give the sampling rate with --rate")
    scale = np.array([channels.u_scale or 1.0, channels.i_scale or 1.0] * len(pairs))
    return quantise(path, table[:, order] * scale, rate, channels.f_nominal or 50.0, start)


def _find(header: list[str]) -> dict[str, str]:
    found = {}
    for name in header:
        plain = name.lower().split("[")[0].split("(")[0].removesuffix("_v").removesuffix("_a").strip()
        found[_ALIASES.get(plain, plain)] = name
    return found


def _column(path: Path, header: list[str], name: str) -> int:
    if name in header:
        return header.index(name)
    if name.isdigit() and int(name) < len(header):
        return int(name)
    raise InputError(path, f"has no column {name!r}; columns are {', '.join(header)}")


def _table(path: Path, lines: list[str], delimiter: str, width: int) -> Floats:
    body = [line.replace('"', "") for line in lines[1:] if line.strip()]
    if delimiter == ";":
        body = [line.replace(",", ".") for line in body]  # decimal comma
    try:
        table = np.loadtxt(body, delimiter=delimiter, ndmin=2) if body else np.empty((0, width))
    except ValueError:
        table = None
    if table is None or table.shape[1] != width:
        raise InputError(path, _first_fault(body, delimiter, width))
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = bad[0]
        raise InputError(path, f"row {row + 2}, column {column + 1}: {table[row, column]} is not a number")
    return table


def _first_fault(body: list[str], delimiter: str, width: int) -> str:
    """Which row and column is not as the header promises."""
    for number, fields in enumerate(csv.reader(body, delimiter=delimiter), start=2):
        if len(fields) != width:
            return f"row {number} has {len(fields)} columns, expected {width} as in the header (cut off?)"
        for column, text in enumerate(fields, start=1):
            if not _is_number(text):
                return f"row {number}, column {column}: {text.strip()!r} is not a number"
    return "is not a table of numbers"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _clock(path: Path, time: Floats, channels: ChannelMap) -> tuple[float, int | None]:
    """Sampling rate [1/s] and start from the time column [s]."""
    if np.abs(time).max() >= LATEST_NS / 1e9:
        raise InputError(path, f"its time column reaches {np.abs(time).max():g} s; expected seconds before 2200")
    start = round(time[0] * 1e9) if time[0] > _UNIX else None
    if channels.rate:
        return channels.rate, start
    if len(time) < 2 or time[-1] <= time[0]:
        raise InputError(path, "its time column does not advance; give the sampling rate with --rate")
    step = float(np.median(np.diff(time)))
    # The whole span tells the step best, unless something is missing in it.
    mean = float((time[-1] - time[0]) / (len(time) - 1))
    period = mean if abs(mean - step) < _JITTER * abs(step) else step
    # Printed times are rounded: a recording at 1970 + 1.7e9 s cannot resolve more than 0.24 us.
    slack = max(_JITTER * period, 2 * np.spacing(abs(time[-1])), 1.1e-6 if start else 0.0)
    expected = time[0] + period * np.arange(len(time))
    uneven = np.flatnonzero(np.abs(time - expected) > slack + 0.5 * period * (period > 0) * _JITTER)
    if len(uneven):
        row = int(uneven[0])
        raise InputError(
            path,
            f"row {row + 2}: time {time[row]:.9g} s breaks the equidistant step of {period:.9g} s; "
            "resample it, or give --rate to overrule the column",
        )
    return float(1 / period), start
