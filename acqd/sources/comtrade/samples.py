"""The data (DAT) of a COMTRADE recording: rows of sample number, time, analog values, status words."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.comtrade.header import AnalogChannel, FileType, Header

Numbers: TypeAlias = NDArray[np.int16 | np.uint16 | np.int32 | np.float32 | np.float64]
_TYPES: dict[FileType, str] = {"BINARY": "<i2", "BINARY32": "<i4", "FLOAT32": "<f4"}
_LARGEST = 2**53
"""A number of a sample beyond it means nothing."""
_NO_TIME = 0xFFFFFFFF
_MISSING: dict[FileType, float] = {"BINARY": -(2**15), "BINARY32": -(2**31), "ASCII": 99_999}
"""Numbers that stand for a missing sample since 1999. In 1991, 0xFFFF does, which is also -1."""


class Samples:
    """Whole rows of the data; columns are read when they are asked for."""

    def __init__(self, path: Path, header: Header, content: bytes | memoryview) -> None:
        """Raises InputError for data that are shorter than the header announces, before any memory is taken."""
        self._path, self._header = path, header
        ascii = header.file_type == "ASCII"
        self._rows: Any = _text_rows(path, header, content) if ascii else _rows(header, content)
        announced, present = header.samples, len(self._rows)
        if present < announced or not present:
            if not present and not announced:
                raise InputError(path, "has no samples")
            raise InputError(
                path,
                f"is truncated: {present} of {announced} samples; transfer it again, or write {present} for "
                f"{announced} in its header to meter what is there",
            )
        self.notes = (f"has {present} samples, of which its header announces the first {announced}",) * (
            0 < announced < present
        )
        """What the user should know."""
        self._rows = self._rows[: announced or present]

    def __len__(self) -> int:
        return len(self._rows)

    def times(self) -> Floats | None:
        """Times of the samples [s] since the first; None where the data have none."""
        ticks = self._rows["time"] if self._rows.dtype.names else self._rows[:, 1]
        if (ticks == _NO_TIME).any() or np.isnan(ticks).any():
            return None
        whole: Floats = (ticks - ticks[0]).astype(np.float64) if ticks.dtype.kind == "f" else _unwrapped(ticks)
        return whole * self._header.tick_s

    def numbers(self) -> NDArray[np.int64]:
        """Numbers of the samples as the data say them."""
        stored = self._rows["number"] if self._rows.dtype.names else self._rows[:, 0]
        known = np.nan_to_num(stored, nan=0.0, posinf=0.0, neginf=0.0)
        return np.asarray(np.clip(known, -_LARGEST, _LARGEST).astype(np.int64))

    def column(self, number: int) -> Numbers:
        """Stored numbers of an analog channel. Raises InputError at a missing sample."""
        channel = self._header.channels[number]
        stored: Numbers = self._rows["analog"][:, number] if self._rows.dtype.names else self._rows[:, 2 + number]
        if self._header.file_type == "BINARY" and channel.maximum > 2**15 - 1:
            stored = stored.view(np.uint16)  # converters of 1991 without a sign
        missing = self._missing(channel, stored)
        if missing.any():
            at = int(np.argmax(missing))
            raise InputError(self._path, f"sample {at + 1} of channel {channel.name!r} is marked as missing")
        return stored

    def _missing(self, channel: AnalogChannel, stored: Numbers) -> NDArray[np.bool_]:
        if self._header.edition == 1991:  # 0xFFFF: outside the range of a converter without a sign, else an ordinary -1
            unsigned = stored.dtype == np.uint16 and channel.maximum < 2**16 - 1
            return np.asarray(stored == 2**16 - 1) if unsigned else np.isnan(stored)
        number = _MISSING.get(self._header.file_type)
        if number is None or (self._header.file_type == "ASCII" and channel.maximum >= number):
            return np.asarray(~np.isfinite(stored))
        return np.asarray((stored == number) | ~np.isfinite(stored))


def _unwrapped(ticks: NDArray[np.uint32]) -> Floats:
    """Ticks of 32 bits since the first, across their overflows."""
    steps = np.diff(ticks.astype(np.uint32))  # modulo 2^32
    return np.concatenate(([0.0], np.cumsum(steps.astype(np.int32), dtype=np.float64)))


def _rows(header: Header, content: bytes | memoryview) -> Any:
    """A view of the binary rows, without copying them."""
    analog = ("analog", _TYPES[header.file_type], (len(header.channels),))
    words = -(-header.digital // 16)
    row = np.dtype([("number", "<u4"), ("time", "<u4"), analog, ("status", "<u2", (words,))])
    return np.frombuffer(content, row, count=len(content) // row.itemsize)


def _text_rows(path: Path, header: Header, content: bytes | memoryview) -> Floats:
    """Numbers of the text rows, [samples, 2 + channels]; a time may be blank."""
    columns = range(2 + len(header.channels))
    most = min(header.samples or len(content), len(content) // 4 + 1)  # loadtxt makes room for as many
    try:
        return np.loadtxt(_lines(content), delimiter=",", usecols=columns, ndmin=2, max_rows=most)
    except (ValueError, IndexError):
        raise InputError(path, _first_fault(_lines(content), len(columns))) from None


def _lines(content: bytes | memoryview) -> Iterable[str]:
    for line in io.TextIOWrapper(io.BytesIO(content), "latin-1"):  # which ends lines at a carriage return alone, too
        text = line.replace("\x1a", "").strip()
        if text:
            number, _, rest = text.partition(",")
            time, comma, values = rest.partition(",")
            yield f"{number},{time.strip() or 'nan'}{comma}{values}"


def _first_fault(lines: Iterable[str], width: int) -> str:
    for row, line in enumerate(lines, start=1):
        fields: Sequence[str] = line.split(",")
        if len(fields) < width:
            return f"sample {row} has {len(fields)} fields, expected {width} (cut off?)"
        for field in fields[:width]:
            try:
                float(field)
            except ValueError:
                return f"sample {row}: {field.strip()!r} is not a number"
    return "its data are no table of numbers"
