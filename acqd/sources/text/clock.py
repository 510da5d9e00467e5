"""Sampling rate and start of a text export: from stamps, or from increment and start above the table."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from acqd.errors import InputError
from acqd.sources.recording.clock import Clock
from acqd.sources.text.layout import Layout, key_of
from acqd.sources.text.table import Table

_DAY_S = 86_400.0
_MULTIPLES = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
_RATE_UNIT = re.compile(
    r"^\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([kKmMgG]?)(?:hz|s/s|sa/s|sps|samples?/s\w*|)\s*$",
    re.IGNORECASE,
)
_TIME_UNIT = re.compile(
    r"^\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(s|sec|seconds?|ms|us|µs|μs|ns|)\s*$", re.IGNORECASE
)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_WHEN = re.compile(
    r"^(?P<quote>'?)(?:(?P<a>\d{1,4})(?P<sign>[-/.])(?P<b>\d{1,2}|[A-Za-z]{3})[-/.](?P<c>\d{1,4})[ T_]*)?"
    r"(?:(?P<h>\d{1,2}):(?P<m>\d{2})(?::(?P<s>\d{2})(?:[.,:](?P<f>\d+))?)?)?\s*(?:(?P<half>[AaPp][Mm])\s*)?"
    r"(?P<zone>Z|[+-]\d{2}:?\d{2})?$"
)
_MONTHS = {
    name: k
    for k, name in enumerate(
        ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"], start=1
    )
}


def of_preamble(path: Path, table: Table, layout: Layout) -> Clock:
    """Increment or rate, and date, of the lines above the table. Raises InputError for values that are none."""
    rate = None
    if text := table.stray.get("increment") or _value(table, layout.increment):
        rate = 1 / _seconds(path, text, "increment")
    elif text := _value(table, layout.rate):
        rate = _hertz(path, text)
    start, notes = _date(table, layout)
    if start is not None and (text := _value(table, layout.offset)):
        start += round(_seconds(path, text, "start", signed=True) * 1e9)
    return Clock(rate, start, notes)


@dataclass(frozen=True, slots=True)
class Stamp:
    """A date, a time of day, or both."""

    days: int | None
    """Since 1970; None: no date, or one that may be of two orders."""
    seconds: float
    """Of the day [s]."""
    zone_s: int | None
    """Local time minus UTC [s]; None: not said."""
    ambiguous: bool = False


def read_stamp(text: str) -> Stamp | None:
    """`2024-05-25 10:15:00.123`, `25.05.2024 10:15:00,5`, `05/25/2024 1:00:00 PM`, `10:15:00.5`; None for others.

    A date in slashes whose day and month may both be the month has no days: it is `ambiguous`.
    """
    match = _WHEN.match(text.strip())
    if match is None or (match["a"] is None and match["h"] is None):
        return None
    days, ambiguous = _days(match)
    if match["a"] is not None and days is None and not ambiguous:
        return None
    hour = int(match["h"] or 0)
    if match["half"]:
        hour = hour % 12 + (12 if match["half"].lower() == "pm" else 0)
    if hour > 24 or int(match["m"] or 0) > 59:
        return None
    seconds = hour * 3600 + int(match["m"] or 0) * 60 + int(match["s"] or 0) + float(f"0.{match['f'] or 0}")
    zone = match["zone"]
    offset = None if zone is None else 0 if zone == "Z" else _offset(zone)
    return Stamp(days, seconds, offset, ambiguous)


def _offset(zone: str) -> int:
    sign = -1 if zone[0] == "-" else 1
    return sign * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60)


def _days(match: re.Match[str]) -> tuple[int | None, bool]:
    """Days since 1970, and whether the order of day and month is open."""
    if match["a"] is None:
        return None, False
    a, b, c = match["a"], match["b"], match["c"]
    if b.lower() in _MONTHS:
        year, month, day = (int(c), _MONTHS[b.lower()], int(a)) if len(a) < 3 else (int(a), _MONTHS[b.lower()], int(c))
    elif not b.isdigit():
        return None, False
    elif len(a) == 4 or match["quote"]:
        year, month, day = int(a), int(b), int(c)
    elif match["sign"] == "-" and len(c) < 4:
        return None, True
    elif match["sign"] == "." or int(a) > 12:
        year, month, day = int(c), int(b), int(a)
    elif int(b) > 12:
        year, month, day = int(c), int(a), int(b)
    elif a != b:
        return None, True
    else:
        year, month, day = int(c), int(b), int(a)
    year += 2000 if year < 70 else 1900 if year < 100 else 0
    try:
        return (datetime(year, month, day, tzinfo=UTC) - datetime(1970, 1, 1, tzinfo=UTC)).days, False
    except ValueError:
        return None, False


def start_of(stamp: Stamp) -> tuple[int | None, tuple[str, ...]]:
    """UTC [ns] of a stamp, and what is uncertain about it."""
    if stamp.ambiguous:
        return None, ("the order of day, month and year of its dates is open: rows start now, or at --start",)
    if stamp.days is None:
        return None, ("its stamps have a time of day, but no date: rows start now, or at --start",)
    utc = round((stamp.days * _DAY_S - (stamp.zone_s or 0)) * 1e9) + round(stamp.seconds * 1e9)
    notes = () if stamp.zone_s is not None else ("its stamps name no time zone; taken as UTC",)
    return utc, notes


def _date(table: Table, layout: Layout) -> tuple[int | None, tuple[str, ...]]:
    """Start from the lines of date and time above the table."""
    day, time = _value(table, layout.date), _value(table, layout.clock)
    text = f"{day} {time}".strip()
    stamp = read_stamp(text) or (read_stamp(day) if day else None)
    if stamp is None or (stamp.days is None and not stamp.ambiguous):
        return None, ()
    return start_of(stamp)


def announced(table: Table, layout: Layout) -> int | None:
    """Number of rows that the lines above the table announce; None: they do not."""
    match = re.search(r"(?:^|:)\s*(\d+)(?:[.,]0*)?(?:e\+?(\d))?\s*$", _value(table, layout.samples).lower())
    return None if match is None else int(match[1]) * 10 ** int(match[2] or 0)


def _value(table: Table, keys: tuple[str, ...]) -> str:
    """The first value of the first of these lines."""
    for key in keys:
        for value in table.preamble.get(key_of(key), ()):
            if value:
                return re.sub(r"^[A-Za-z]*:\s*(?=[\d.+-])", "", value)  # `Analog:1.0E-04` of Siglent, `:50us` of OWON
    return ""


def _seconds(path: Path, text: str, what: str, *, signed: bool = False) -> float:
    match = _TIME_UNIT.match(text)
    value = float(match.group(1).replace(",", ".")) if match else 0.0
    if match is None or (value <= 0 and not signed):
        raise InputError(path, f"its {what} is {text!r}; expected a time like 5e-05 or 50 us")
    unit = match.group(2).lower()
    return value * (_SECONDS.get(unit) or 1.0)


def _hertz(path: Path, text: str) -> float:
    match = _RATE_UNIT.match(text)
    value = float(match.group(1).replace(",", ".")) if match else 0.0
    if match is None or value <= 0:
        raise InputError(path, f"its sampling rate is {text!r}; expected one like 20000 or 20 kHz")
    return value * _MULTIPLES[match.group(2).lower()]
