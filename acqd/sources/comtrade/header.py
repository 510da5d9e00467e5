"""The configuration (CFG) of a COMTRADE recording."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from acqd.errors import InputError
from acqd.sources.comtrade.stamp import has_nanoseconds, month_first, offset_s, utc_ns

FileType = Literal["ASCII", "BINARY", "BINARY32", "FLOAT32"]
SIMULATED = "simulated"
"""Name of the recorder in files that hold the samples of a simulation."""
_KNOWN = (1991, 1999, 2001, 2013)
_UNIT = re.compile(r"\s*(hz|;)\s*$", re.IGNORECASE)
"""What recorders write behind a frequency or a rate."""


@dataclass(frozen=True, slots=True)
class AnalogChannel:
    """One analog channel: value = a * x + b in `unit`."""

    name: str
    phase: str
    circuit: str
    unit: str
    a: float
    b: float
    skew_us: float
    """How much later than the sample's time the channel is sampled [us]."""
    maximum: float
    """Largest number that the channel's data can hold."""
    ratio: float
    """Primary quantity per secondary one (VT, CT)."""
    secondary: bool
    """The values are secondary quantities."""


@dataclass(frozen=True, slots=True)
class Segment:
    """Samples of one rate."""

    rate: float
    """[1/s]; 0: the samples have times."""
    end: int
    """Number of the last sample, from 1."""


@dataclass(frozen=True, slots=True)
class Header:
    """What the CFG says."""

    edition: int
    channels: list[AnalogChannel]
    digital: int
    """Number of status channels."""
    frequency: float
    """Nominal mains frequency [Hz]; 0: not said."""
    segments: list[Segment]
    start_utc_ns: int | None
    file_type: FileType
    tick_s: float
    """Unit of the samples' times [s]."""
    device: str = ""
    """Name of the recorder."""
    notes: tuple[str, ...] = ()
    """What was read otherwise than its edition says."""

    @property
    def samples(self) -> int:
        """Samples that the header announces; 0: as many as there are."""
        return self.segments[-1].end


def read_header(path: Path, text: str) -> Header:
    """The header in `text`. Raises InputError, which names the line that is wrong."""
    lines = _Lines(path, text)
    head = lines.fields(2)
    station = head[1]
    edition, notes = _edition(lines, head[2] if len(head) > 2 else "")
    counts = lines.fields(2)
    analog, digital = lines.count(counts, "A"), lines.count(counts, "D")
    channels = [_channel(lines) for _ in range(analog)]
    for _ in range(digital):
        lines.next()
    frequency = lines.first_number()
    segments = _segments(lines)
    start, trigger = lines.next(), lines.next()
    kind = lines.next().upper()
    file_type = next((name for name in get_args(FileType) if name == kind), None)
    if file_type is None:
        raise lines.wrong(f"file type {kind!r} is unknown; expected {', '.join(get_args(FileType))}")
    factor = lines.number(lines.optional().rstrip(", ") or "1") if edition >= 1999 else 1.0
    code = lines.optional().partition(",")[0] if edition >= 2013 else ""
    try:
        order = month_first(start, trigger, edition == 1991)
        utc = utc_ns(start, order.month_first, offset_s(code))
        said = (*notes, order.note) if order.note else notes
    except ValueError as error:
        utc, said = None, (*notes, f"its header: {error}: rows start now, or at --start")
    tick = 1e-9 if has_nanoseconds(start) or has_nanoseconds(trigger) else 1e-6
    return Header(edition, channels, digital, frequency, segments, utc, file_type, tick * factor, station, said)


def _segments(lines: _Lines) -> list[Segment]:
    """Segments; with a number of 0 one line follows, whose rate may be 0: the samples have times."""
    segments = []
    for _ in range(max(1, int(lines.first_number()))):
        rate, end, *_ = lines.fields(2)
        segments.append(Segment(lines.number(_UNIT.sub("", rate) or "0"), int(lines.number(end or "0"))))
    return segments


class _Lines:
    """The lines of a header, one after the other."""

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._lines = text.replace("\x1a", "").lstrip("\ufeff\r\n \t").splitlines()
        if not any(line.strip() for line in self._lines[1:12:2]):  # a blank line after every line
            self._lines = self._lines[::2]
        self._number = 0

    def next(self) -> str:
        if self._number >= len(self._lines):
            raise InputError(self._path, f"its header ends after line {self._number}; is it cut off?")
        return self.optional()

    def optional(self) -> str:
        self._number += 1
        return self._lines[self._number - 1].strip() if self._number <= len(self._lines) else ""

    def fields(self, least: int, *, skip_blank: bool = False) -> list[str]:
        line = self.next()
        while skip_blank and not line:
            line = self.next()
        fields = [field.strip() for field in line.split(",")]
        if len(fields) < least:
            raise self.wrong(f"has {len(fields)} fields, expected {least} or more")
        return fields

    def first_number(self) -> float:
        """The number that is alone in a line, which may end with a comma; 0 where the line is empty."""
        return self.number(_UNIT.sub("", self.next().partition(",")[0]).strip() or "0")

    def number(self, text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            raise self.wrong(f"{text!r} is not a number") from None
        if not math.isfinite(value) or not abs(value) < 1e15:
            raise self.wrong(f"{text!r} is no usable number")
        return value

    def limit(self, text: str) -> float:
        """The largest number that data can hold, which of floating-point data has no end."""
        try:
            return min(float(text), 1e15)
        except ValueError:
            raise self.wrong(f"{text!r} is not a number") from None

    def count(self, fields: list[str], letter: str) -> int:
        """Number of channels of a kind, from `36,20A,16D`: each has a line, so the header limits it."""
        text = next((field[:-1] for field in fields[1:] if field[-1:].upper() == letter), "")
        if not text and letter == "A":
            raise self.wrong(f"{','.join(fields)!r} has no number of analog channels; expected a line like 36,20A,16D")
        text = text or "0"
        count, left = self.number(text), len(self._lines) - self._number
        if not 0 <= count <= left:
            raise self.wrong(f"announces {text}{letter} channels, but {left} lines follow")
        return int(count)

    def wrong(self, problem: str) -> InputError:
        return InputError(self._path, f"its header, line {self._number}: {problem}")


def _edition(lines: _Lines, text: str) -> tuple[int, tuple[str, ...]]:
    """The edition whose rules hold: recorders also write the year of their firmware or of a draft (1997, 2000, 0)."""
    if not text:
        return 1991, ()
    number = lines.number(text)
    if number in _KNOWN:
        return int(number), ()
    if number != int(number) or not (0 <= number <= 9 or 1980 <= number < 2100):
        raise lines.wrong(f"edition {text!r} is unknown; expected {', '.join(map(str, _KNOWN))}")
    edition = 2013 if number > 2012 else 1991 if 1980 <= number < 1997 else 1999
    return edition, (f"its header names edition {text}; read as {edition}",)


def _channel(lines: _Lines) -> AnalogChannel:
    """Fields: number, name, phase, circuit, unit, a, b, skew, min, max[, primary, secondary, P or S]."""
    fields = lines.fields(10, skip_blank=True)
    a, b, skew = (lines.number(text or "0") for text in fields[5:8])
    maximum = lines.limit(fields[9] or "0")
    primary, secondary = (lines.number(text or "0") for text in [*fields[10:12], "", ""][:2])
    ratio = primary / secondary if primary > 0 and secondary > 0 else 1.0
    kind = fields[12].upper() if len(fields) > 12 else ""
    return AnalogChannel(fields[1], fields[2], fields[3], fields[4], a, b, skew, maximum, ratio, kind == "S")
