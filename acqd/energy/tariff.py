"""What a kWh costs and emits: a tariff from a TOML file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime, time
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Literal
from zoneinfo import ZoneInfo

import numpy as np
from pydantic import Field, ValidationError

from acqd.energy.periods import parse_shifts, zone_of
from acqd.energy.price_series import Series, read_series
from acqd.errors import InputError, UserError, in_our_words, place_in_file
from acqd.section import FileName, Section
from acqd.toml_file import tables_of

_DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_DAY_MIN = 1440
QUARTER_S = 900
"""A quarter hour, for which energy is billed and netted."""
Price = Annotated[float, Field(ge=-100, le=100)]


class _Window(Section):
    """A price for hours of some days of some months."""

    price: Price
    days: str = "mon-sun"
    hours: str = "00:00-24:00"
    months: str = "jan-dec"


class _PriceSeries(Section):
    file: FileName
    unit: Literal["EUR/kWh", "EUR/MWh", "ct/kWh"]
    surcharge: Price = 0.0
    """EUR per kWh on top: grid, levies."""


class _Co2Series(Section):
    file: FileName
    unit: Literal["kg/kWh", "g/kWh"]


class _Capacity(Section):
    price: Annotated[float, Field(ge=0, le=1e6)]
    """EUR per kW of the highest mean of 15 min."""
    per: Literal["year", "month"] = "year"


class _File(Section):
    name: str = ""
    zone: Annotated[str, Field(min_length=1)] | None = None
    shifts: str | None = None
    price: Price | None = None
    time_of_use: tuple[_Window, ...] = Field(default=(), strict=False)
    series: _PriceSeries | None = None
    feed_in: Price = 0.0
    """EUR per exported kWh, received."""
    capacity: _Capacity | None = None
    co2: Annotated[float, Field(ge=0, le=10)] | None = None
    co2_series: _Co2Series | None = None


@dataclass(frozen=True, slots=True)
class Weekly:
    """Prices by local month, day and minute."""

    zone: ZoneInfo
    prices: tuple[Fraction, ...]
    number: np.ndarray
    """[12, 7, 1440] index into `prices`."""

    def at(self, moments: np.ndarray) -> list[Fraction]:
        """Prices at Unix times [s]."""
        local = [datetime.fromtimestamp(moment, self.zone) for moment in moments.tolist()]
        return [self.prices[self.number[t.month - 1, t.weekday(), t.hour * 60 + t.minute]] for t in local]


@dataclass(frozen=True, slots=True)
class Tariff:
    """Prices in EUR and emissions in kg per imported kWh."""

    name: str = ""
    zone: ZoneInfo | None = None
    shifts: tuple[time, ...] = ()
    price: Fraction | Weekly | Series | None = None
    surcharge: Fraction = Fraction(0)
    feed_in: Fraction = Fraction(0)
    capacity_price: Fraction | None = None
    """EUR per kW of the highest mean of 15 min, per `capacity_per`."""
    capacity_per: Literal["year", "month"] = "year"
    co2: Fraction | Series | None = None

    def prices(self, moments: np.ndarray) -> list[Fraction] | None:
        """EUR per kWh at Unix times [s]; None: the tariff has no price. Raises InputError outside of a series."""
        found = _at(self.price, moments)
        return found if found is None or not self.surcharge else [one + self.surcharge for one in found]

    @property
    def mean_price(self) -> float | None:
        """EUR per kWh, a mean over all minutes of the year or over the series; None without a price."""
        if self.price is None:
            return None
        if isinstance(self.price, Fraction):
            return float(self.price + self.surcharge)
        if isinstance(self.price, Weekly):
            return float(np.array([float(each) for each in self.price.prices])[self.price.number].mean())
        lasting = np.diff(np.append(self.price.start, self.price.end))
        mean = np.average([float(each) for each in self.price.values], weights=lasting)
        return float(mean) + float(self.surcharge)

    def emissions(self, moments: np.ndarray) -> list[Fraction] | None:
        """Kg CO2 per kWh at Unix times [s]."""
        return _at(self.co2, moments)

    @property
    def by_minute(self) -> bool:
        """Whether prices or factors change within a quarter hour."""
        series = [each for each in (self.price, self.co2) if isinstance(each, Series)]
        if any(bool(np.any(each.start % QUARTER_S)) for each in series):
            return True
        return isinstance(self.price, Weekly) and bool(np.any(self.price.number != _by_quarters(self.price.number)))

    @property
    def resolution(self) -> int:
        """Seconds for whose length prices and factors hold."""
        return 60 if self.by_minute else QUARTER_S


def _at(price: Fraction | Weekly | Series | None, moments: np.ndarray) -> list[Fraction] | None:
    if price is None:
        return None
    return [price] * len(moments) if isinstance(price, Fraction) else price.at(moments)


def _by_quarters(number: np.ndarray) -> np.ndarray:
    return np.repeat(number[:, :, ::15], 15, axis=2)


def load_tariff(path: Path, zone: str | None = None) -> Tariff:
    """Read a tariff; `zone` stands for the file's, where it has none. Raises UserError."""
    try:
        given = _File.model_validate(tables_of(path))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    except ValidationError as error:
        first = error.errors()[0]
        said = in_our_words(first["msg"])
        if first["loc"][-1] in ("price", "feed_in", "surcharge") and "capacity" not in first["loc"]:
            said += " in EUR/kWh"
        if first["type"] == "extra_forbidden" and len(first["loc"]) == 1:
            said += f" The keys are {', '.join(_File.model_fields)}"
        raise InputError(path, f"{place_in_file(first['loc'])}: {said}") from None
    try:
        return _tariff(path, given, zone)
    except InputError:
        raise
    except UserError as error:
        raise InputError(path, str(error)) from None


def _tariff(path: Path, given: _File, zone: str | None) -> Tariff:
    kinds = [name for name in ("price", "time_of_use", "series") if getattr(given, name) not in (None, ())]
    if len(kinds) > 1:
        raise UserError(f"{' and '.join(kinds)} both give a price; keep one")
    if given.co2 is not None and given.co2_series is not None:
        raise UserError("co2 and co2_series both give a factor; keep one")
    if not kinds and given.capacity is None and given.co2 is None and given.co2_series is None:
        raise UserError("gives no price; expected price, [[time_of_use]], [series], [capacity] or co2")
    local = zone_of(given.zone or zone) if given.zone or zone or given.time_of_use else None
    price: Fraction | Weekly | Series | None = None if given.price is None else _exact(given.price)
    if given.time_of_use:
        assert local is not None
        price = _weekly(given.time_of_use, local)
    if given.series is not None:
        price = read_series(path.parent / given.series.file, given.series.unit)
    co2: Fraction | Series | None = None if given.co2 is None else _exact(given.co2)
    if given.co2_series is not None:
        co2 = read_series(path.parent / given.co2_series.file, given.co2_series.unit)
    return Tariff(
        given.name or path.stem, local, tuple(parse_shifts(given.shifts)) if given.shifts else (), price,
        _exact(given.series.surcharge) if given.series else Fraction(0), _exact(given.feed_in),
        _exact(given.capacity.price) if given.capacity else None, given.capacity.per if given.capacity else "year", co2,
    )  # fmt: skip


def _exact(price: float) -> Fraction:
    """The decimal number that the file has, not the binary one next to it."""
    return Fraction(repr(price))


def _weekly(windows: tuple[_Window, ...], zone: ZoneInfo) -> Weekly:
    """One price for every minute of the week. Raises UserError for holes and overlaps."""
    number = np.full((12, 7, _DAY_MIN), -1)
    for k, window in enumerate(windows):
        months, days = _named(window.months, _MONTHS), _named(window.days, _DAYS)
        place = np.ix_(months, days, _minutes(window.hours))
        taken = number[place]
        if (taken >= 0).any():
            month, day, minute = (int(axis[0]) for axis in np.nonzero(taken >= 0))
            at = _shown(months[month], days[day], _minutes(window.hours)[minute])
            raise UserError(f"time_of_use {int(taken.max()) + 1} and {k + 1} both give a price for {at}")
        number[place] = k
    holes = np.argwhere(number < 0)
    if len(holes):
        raise UserError(f"time_of_use gives no price for {_shown(*holes[0].tolist())}")
    return Weekly(zone, tuple(_exact(window.price) for window in windows), number)


def _shown(month: int, day: int, minute: int) -> str:
    return f"{_DAYS[day]} {minute // 60:02d}:{minute % 60:02d} in {_MONTHS[month]}"


def _named(text: str, names: tuple[str, ...]) -> list[int]:
    """Places of names: mon-fri, or sat,sun; a range may pass the end (nov-feb)."""
    places: set[int] = set()
    for part in text.lower().split(","):
        ends = [each.strip()[:3] for each in part.split("-")]
        if not 1 <= len(ends) <= 2 or any(each not in names for each in ends):
            raise UserError(f"{text!r}: expected names like {names[0]}-{names[4]} or {names[5]},{names[6]}")
        first, last = names.index(ends[0]), names.index(ends[-1])
        places |= {place % len(names) for place in range(first, last + 1 + (len(names) if last < first else 0))}
    return sorted(places)


def _minutes(text: str) -> list[int]:
    """Minutes of the day: 06:00-22:00, 22:00-06:00, several with commas."""
    found: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d\d?):(\d\d)\s*-\s*(\d\d?):(\d\d)\s*", part)
        ends = [] if match is None else [60 * int(match[k]) + int(match[k + 1]) for k in (1, 3)]
        if not ends or max(ends) > _DAY_MIN or ends[0] == ends[1] or any(int(match[k]) > 59 for k in (2, 4)):  # type: ignore[index]
            raise UserError(f"hours {text!r}: expected times like 06:00-22:00")
        first, last = ends
        found |= {minute % _DAY_MIN for minute in range(first, last + (_DAY_MIN if last < first else 0))}
    return sorted(found)
