"""Times in COMTRADE headers: dates of the three editions, and the offset of local time from UTC."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_DATE = re.compile(r"(\d{1,2})[/.-](\d{1,2})[/.-](\d{2,4})$")
_YEAR_FIRST = re.compile(r"(\d{4})[/.-](\d{1,2})[/.-](\d{1,2})(?=$|[ T,])")
_TIME = re.compile(r"(\d{1,2}):(\d{1,2}):(\d{1,2})(?:[.,](\d{1,12}))?$")
_OFFSET = re.compile(r"([+-]?)(\d{1,2})(?:[hH](\d{1,2})?)?$")
_PIVOT = 70  # two-digit years from here on are 19xx


def utc_ns(line: str, month_first: bool, offset_s: int = 0) -> int | None:
    """`dd/mm/yyyy,hh:mm:ss.ssssss` (1991: month first) as UTC [ns since 1970]; None without a date after 1970.

    `offset_s` is local time minus UTC. Raises ValueError for a line that is no time.
    """
    if not line.strip(" ,\t"):
        return None
    year_first = _YEAR_FIRST.match(line.strip())
    if year_first is not None:  # as ISO 8601 writes dates
        year, month, day = year_first.groups()
        line, month_first = f"{day}/{month}/{year},{line.strip()[year_first.end() :].lstrip(' T,')}", False
    date, _, time = (part.strip() for part in line.strip().replace(",", " ", 1).partition(" "))
    days, clock = _DATE.match(date), _TIME.match(time)
    if days is None or clock is None:
        raise ValueError(f"{line.strip()!r} is no time like 31/12/2025,23:59:59.999999")
    one, two, year = (int(text) for text in days.groups())
    day, month = (two, one) if month_first else (one, two)
    if len(days.group(3)) == 2:
        year += 1900 if year >= _PIVOT else 2000
    if year < 1971 or not day or not month:
        return None
    hour, minute, second = (int(text) for text in clock.groups()[:3])
    leap, second = divmod(second, 60)  # 60 in a leap second
    days_on, hour = (1, 0) if (hour, minute, second) == (24, 0, 0) else (0, hour)  # the end of a day, ISO 8601
    delta = datetime(year, month, day, hour, minute, second, tzinfo=UTC) - _EPOCH
    fraction = int((clock.group(4) or "0").ljust(12, "0")) // 1000
    return ((delta.days + days_on) * 86_400 + delta.seconds + 60 * leap - offset_s) * 1_000_000_000 + fraction


@dataclass(frozen=True, slots=True)
class DateOrder:
    """Whether dates of a header have the month first, and what to say about it."""

    month_first: bool
    note: str = ""


def month_first(start: str, trigger: str, usual: bool) -> DateOrder:
    """Order of day and month: `usual` of the edition, unless a date is possible in the other order only."""
    dates = [found for line in (start, trigger) if (found := _DATE.match(line.partition(",")[0].strip()))]
    first = [int(found.group(1)) for found in dates]
    second = [int(found.group(2)) for found in dates]
    month, day = (first, second) if usual else (second, first)
    if not any(one > 12 for one in month):
        return DateOrder(usual)
    if any(one > 12 for one in day):
        raise ValueError(f"{start.strip()!r} is no date like 31/12/2025")
    words = ("month", "day") if not usual else ("day", "month")
    return DateOrder(not usual, f"its dates have the {words[0]} first: {start.partition(',')[0].strip()}")


def has_nanoseconds(line: str) -> bool:
    """Whether the fraction of a second has more than 6 digits: then times of samples are in ns, else in us."""
    return len(line.rpartition(".")[2].strip()) > 6 if "." in line else False


def offset_s(code: str) -> int:
    """Local time minus UTC [s] of a time code of 2013 such as `-5h30`, `+10`, `0`; `x` means UTC.

    Raises ValueError for anything else.
    """
    text = code.strip()
    if text.lower() in ("", "x"):
        return 0
    found = _OFFSET.match(text)
    if found is None:
        raise ValueError(f"time code {text!r} is not like -5h30, +2 or 0")
    sign, hours, minutes = found.groups()
    return (-1 if sign == "-" else 1) * (int(hours) * 3600 + int(minutes or 0) * 60)
