"""CSV recordings: a header, then one row per sample; voltages in V, currents in A, time in s."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.text_file import encoding_of
from acqd.sources.waveform import LATEST_NS, QUANTITIES, ChannelMap, Waveform, physical, positions

_TIME = ("time", "t", "t_s", "time_s", "seconds")
_ALIASES = {"u": "u1", "v": "u1", "v1": "u1", "v2": "u2", "v3": "u3", "i": "i1"}
_JITTER = 0.01  # of one period: a larger deviation is not an equidistant recording
_UNIX = 1e8  # a time column beyond this counts from 1970, below it from the recording's start


def load(path: Path, channels: ChannelMap) -> Waveform:
    """Columns by name (`time,u1,i1,u2,i2,u3,i3`) or by --map; values keep their precision. Raises InputError."""
    text = _Text(path, channels.encoding or encoding_of(path))
    header = text.header()
    if all(_is_number(name) for name in header):
        raise InputError(path, "row 1 has no names; expected a header like time,u1,i1")
    pairs = channels.pairs(path, {} if channels.columns else _by_name(path, header))
    order = positions(path, header, pairs, "column")
    table = text.table()
    if not len(table):
        raise InputError(path, "has a header but no samples")
    clock = [k for k, name in enumerate(header) if name.lower() in _TIME]
    rate, start = _clock(path, table[:, clock[0]], channels) if clock else (channels.rate, None)
    if rate is None:
        raise InputError(path, "has no time column; give the sampling rate with --rate")
    scale = [channels.u_scale or 1.0, channels.i_scale or 1.0] * len(pairs)
    return physical(path, table[:, order], scale, rate, channels.f_nominal or 50.0, start)


def _by_name(path: Path, header: list[str]) -> dict[str, str]:
    """Columns by what their names say. Raises InputError where two columns are the same quantity."""
    found: dict[str, str] = {}
    for name in header:
        plain = name.lower().split("[")[0].split("(")[0].removesuffix("_v").removesuffix("_a").strip()
        key = _ALIASES.get(plain, plain)
        if key in QUANTITIES and key in found:
            raise InputError(
                path,
                f"has two columns for {key}, {found[key]!r} and {name!r}; "
                f"say which with --map u1=0,... (columns: {', '.join(f'{k}={n}' for k, n in enumerate(header))})",
            )
        found[key] = name
    return found


class _Text:
    """The rows of a file as text, read again by every method: never all of them in memory."""

    def __init__(self, path: Path, encoding: str) -> None:
        self._path, self._encoding = path, encoding
        self._delimiter, self._width = ",", 0

    def header(self) -> list[str]:
        """Names in the first row, which also shows the delimiter."""
        first = next(self._lines(), None)
        if first is None:
            raise InputError(self._path, "is empty")
        self._delimiter = next((d for d in ";\t," if d in first), ",")
        names = [name.strip().strip('"').strip() for name in first.split(self._delimiter)]
        self._width = len(names)
        return names

    def table(self) -> Floats:
        """Numbers of the other rows. Raises InputError, which names row and column of anything else."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that there are no rows
                table = np.loadtxt(self._rows(), delimiter=self._delimiter, ndmin=2, comments=None)
        except ValueError:
            table = None
        if table is not None and not table.size:
            return np.empty((0, self._width))
        if table is None or table.shape[1] != self._width:
            raise InputError(self._path, self._first_fault())
        bad = np.argwhere(~np.isfinite(table))
        if len(bad):
            row, column = bad[0]
            raise InputError(self._path, f"row {row + 2}, column {column + 1}: {table[row, column]} is not a number")
        return table

    def _rows(self) -> Iterator[str]:
        lines = self._lines()
        next(lines)
        comma = self._delimiter == ";"  # then numbers may have decimal commas
        for line in lines:
            if line.strip():
                row = line.replace('"', "")
                yield row.replace(",", ".") if comma else row

    def _lines(self) -> Iterator[str]:
        try:
            with self._path.open(encoding=self._encoding) as file:
                yield from file
        except UnicodeError:
            raise InputError(
                self._path, f"is not text in {self._encoding}; give its encoding with --encoding"
            ) from None

    def _first_fault(self) -> str:
        """Which row and column is not as the header promises."""
        for number, fields in enumerate(csv.reader(self._rows(), delimiter=self._delimiter), start=2):
            if len(fields) != self._width:
                return f"row {number} has {len(fields)} columns, expected {self._width} as in the header (cut off?)"
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
        # From row to row: against the even grid, a missing row shifts all others.
        row = int(np.argmax(np.abs(np.diff(time) - step))) + 1
        raise InputError(
            path,
            f"row {row + 2}: time {time[row]:.9g} s is {time[row] - time[row - 1]:.6g} s after the row before, "
            f"expected an equidistant step of {step:.6g} s; resample it, or give --rate to overrule the column",
        )
    return float(1 / period), start
