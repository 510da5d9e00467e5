"""Periods of local time: days of 23, 24 and 25 hours, weeks, months, shifts; and ranges such as last week."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Literal, get_args
from zoneinfo import ZoneInfo

from acqd.errors import UserError

Split = Literal["hour", "day", "week", "month", "shift", "total"]
SPLITS: tuple[Split, ...] = get_args(Split)
_QUARTER_S = 900
_LONGEST_DAYS = 3700


@dataclass(frozen=True, slots=True)
class Range:
    """Two Unix times [s], whole minutes."""

    begin: int
    end: int


def zone_of(name: str | None) -> ZoneInfo:
    """A zone of the IANA database; None: that of this computer. Raises UserError."""
    wanted = name or _own_zone()
    try:
        return ZoneInfo(wanted)
    except (OSError, ValueError, KeyError):  # ZoneInfoNotFoundError is a KeyError
        whose = "" if name else " of this computer (TZ, /etc/localtime)"
        remedy = "expected a name like Europe/Berlin (on Debian: package tzdata)"
        raise UserError(f"zone {wanted!r}{whose} is unknown; {remedy}") from None


def _own_zone() -> str:
    """The zone of this computer by name: TZ, else the link /etc/localtime, else UTC."""
    variable = os.environ.get("TZ", "").removeprefix(":")
    if variable:
        return variable
    try:
        _, mark, name = str(Path("/etc/localtime").readlink()).partition("zoneinfo/")
    except OSError:
        return "UTC"
    return name if mark else "UTC"


def parse_moment(option: str, text: str, zone: ZoneInfo) -> int:
    """Unix time [s] of `2026-11-16`, `2026-11-16T06:00` (local time) or a time with an offset. Raises UserError."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise UserError(f"{option} {text!r}: expected a time like 2026-11-16 or 2026-11-16T06:00+01:00") from None
    if not 1971 <= moment.year < 2200:
        raise UserError(f"{option} {text!r}: expected a time between 1971 and 2199")
    if moment.second or moment.microsecond:
        raise UserError(f"{option} {text!r}: expected a whole minute, without seconds")
    if moment.tzinfo is None:
        first, second = (moment.replace(tzinfo=zone, fold=fold) for fold in (0, 1))
        if first.utcoffset() != second.utcoffset():
            why = (
                "exists twice"
                if first.astimezone(UTC).astimezone(zone).replace(tzinfo=None) == moment
                else "is left out"
            )
            raise UserError(f"{option} {text!r}: this local time {why} in {zone.key}; write the offset, as in +01:00")
        moment = first
    return round(moment.timestamp())


def last_range(name: str, now: float, zone: ZoneInfo) -> tuple[Range, Range]:
    """The last complete day, week (from Monday), month or year, and the one before. Raises UserError."""
    today = datetime.fromtimestamp(now, zone).date()
    begin = _floor(name, today)
    if begin is None:
        raise UserError(f"--last {name!r}: expected day, week, month or year")
    starts = [_midnight(each, zone) for each in _backwards(name, begin, 2)]
    return Range(starts[1], starts[0]), Range(starts[2], starts[1])


def this_range(name: str, now: float, zone: ZoneInfo) -> tuple[Range, Range]:
    """The running day, week, month or year up to the last full quarter hour, and as much of the one before."""
    today = datetime.fromtimestamp(now, zone).date()
    floor = _floor(name, today)
    if floor is None:
        raise UserError(f"--this {name!r}: expected day, week, month or year")
    starts = [_midnight(each, zone) for each in _backwards(name, floor, 1)]
    end = max(int(now) // _QUARTER_S * _QUARTER_S, starts[0] + _QUARTER_S)
    as_far = datetime.combine(_backwards(name, floor, 1)[1] + (datetime.fromtimestamp(end, zone).date() - floor),
                              datetime.fromtimestamp(end, zone).time(), zone)  # fmt: skip
    return Range(starts[0], end), Range(starts[1], min(round(as_far.timestamp()), starts[0]))


def current(name: str, now: float, zone: ZoneInfo) -> Range:
    """The whole day, week or month that `now` is in."""
    floor = _floor(name, datetime.fromtimestamp(now, zone).date())
    assert floor is not None
    after = _floor(name, floor + timedelta(days={"day": 1, "week": 7}.get(name, 31)))
    assert after is not None
    return Range(_midnight(floor, zone), _midnight(after, zone))


def before(chosen: Range, zone: ZoneInfo) -> Range:
    """As many local days before, or for other lengths as many seconds."""
    begin, end = (datetime.fromtimestamp(moment, zone) for moment in (chosen.begin, chosen.end))
    days = (end.date() - begin.date()).days
    if days and begin.time() == end.time():
        earlier = datetime.combine(begin.date() - timedelta(days=days), begin.time(), zone)
        return Range(round(earlier.timestamp()), chosen.begin)
    return Range(2 * chosen.begin - chosen.end, chosen.begin)


def days_before(end: int, days: int, zone: ZoneInfo) -> int:
    """Local midnight so many days before the day of `end`, Unix s."""
    return _midnight(datetime.fromtimestamp(end, zone).date() - timedelta(days=days), zone)


def boundaries(chosen: Range, by: Split, zone: ZoneInfo, shifts: Sequence[time] = ()) -> list[int]:
    """Unix times [s] at which periods begin, and the end of the last. The first and the last may be cut."""
    if chosen.end <= chosen.begin:
        raise UserError("the period ends before it begins; check --from and --to")
    if chosen.end - chosen.begin > _LONGEST_DAYS * 86_400:
        raise UserError(f"the period is longer than {_LONGEST_DAYS} days; choose a shorter one")
    inside = sorted({at for at in _starts(chosen, by, zone, shifts) if chosen.begin < at < chosen.end})
    return [chosen.begin, *inside, chosen.end]


def parse_shifts(text: str) -> list[time]:
    """Starts of shifts in local time, rising: 06:00,14:00,22:00. Raises UserError."""
    try:
        starts = [time.fromisoformat(each.strip()) for each in text.split(",")]
    except ValueError:
        raise UserError(f"shifts {text!r}: expected starts like 06:00,14:00,22:00") from None
    if any(later <= earlier for earlier, later in pairwise(starts)) or any(each.second for each in starts):
        raise UserError(f"shifts {text!r}: expected whole minutes in rising order, like 06:00,14:00,22:00")
    return starts


def label(begin: int, by: Split, zone: ZoneInfo) -> str:
    """A period in the words of a calendar; hours with their offset, which tells the two 02:00 of autumn apart."""
    at = datetime.fromtimestamp(begin, zone)
    if by == "hour":
        return f"{at:%Y-%m-%d %H:%M%z}"
    if by == "shift":
        return f"{at:%a %Y-%m-%d %H:%M}"
    if by == "week":
        return f"{at:%G-W%V}"
    return f"{at:%Y-%m}" if by == "month" else f"{at:%a %Y-%m-%d}"


def _starts(chosen: Range, by: Split, zone: ZoneInfo, shifts: Sequence[time]) -> Iterator[int]:
    if by == "total":
        return
    if by == "hour":  # where the local minute is 0: zones may lie half an hour off, and change by half an hour
        first = chosen.begin // _QUARTER_S * _QUARTER_S
        yield from (at for at in range(first, chosen.end, _QUARTER_S) if datetime.fromtimestamp(at, zone).minute == 0)
        return
    if by == "shift" and not shifts:
        raise UserError("--by shift needs --shifts 06:00,14:00,22:00, or `shifts` in the tariff")
    first_day = datetime.fromtimestamp(chosen.begin, zone).date()
    last_day = datetime.fromtimestamp(chosen.end, zone).date()
    for number in range((last_day - first_day).days + 1):
        day = first_day + timedelta(days=number)
        if by == "shift":
            yield from (round(datetime.combine(day, start, zone).timestamp()) for start in shifts)
        elif by == "day" or (by == "week" and day.weekday() == 0) or (by == "month" and day.day == 1):
            yield _midnight(day, zone)


def _midnight(day: date, zone: ZoneInfo) -> int:
    """Unix time [s] at which a local day begins; where midnight is left out, the moment of the change."""
    return round(datetime.combine(day, time(), zone).timestamp())


def _floor(name: str, day: date) -> date | None:
    floors = {
        "day": day, "week": day - timedelta(days=day.weekday()), "month": day.replace(day=1),
        "year": day.replace(month=1, day=1),
    }  # fmt: skip
    return floors.get(name)


def _backwards(name: str, begin: date, count: int) -> list[date]:
    """The begin of a calendar period and of the `count` before."""
    found = [begin]
    for _ in range(count):
        floor = _floor(name, found[-1] - timedelta(days=1))
        assert floor is not None
        found.append(floor)
    return found
