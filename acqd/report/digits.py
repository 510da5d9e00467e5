"""Numbers with the digits that they deserve."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

FEWEST_FOR_INTERVAL = 5
"""Recordings: resampling fewer of them says next to nothing about others."""
_MOST_DECIMALS = 6
_ALL = 5e-5
"""A share that lacks less is shown as 100 %."""
_SYMBOLS = "[nµmkMGT]?(?:Wh?|VAh?|varh?|V|A|J|Hz|B|g|m|s|N|Nm|K|Ohm)"
_UNITS_AFTER_NUMBER = re.compile(
    rf"(?<=\d) (?:%|°C|ppm|dB|EUR|min|h|d|rad|deg|degC|{_SYMBOLS})(?!\w)(?: (?:m|s)(?:/\w+)?(?!\w))*"
    r"|(?<=\d) (?:\+-|±) ?(?=\d)"
)
"""The second factor of a product of units, too: kg m, Nm s/rad; and what stands between a value and its error."""
_PREFIXES = {-3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G", 4: "T"}


def number(value: float, digits: int = 3) -> str:
    """A number with at least so many significant digits, without an exponent between 1e-4 and 1e6."""
    if not math.isfinite(value):
        return "-"
    if value == 0:
        return "0"
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{_decimals(abs(value), digits)}f}"


def with_error(value: float, half: float) -> str:
    """A number with the decimals of its error, `half`, which has two significant digits below 35.5, else one.

    This is the rule of the Particle Data Group (Review of Particle Physics, section 5.3).
    """
    if not (math.isfinite(half) and half > 0):
        return number(value)
    leading = float(f"{half:.2e}".partition("e")[0])
    text = f"{value:.{_decimals(half, 2 if leading < 3.55 else 1)}f}"
    return text if float(text) else text.removeprefix("-")  # no "-0.0"


def interval(low: float, high: float) -> str:
    """Two bounds with the decimals of half their distance."""
    half = (high - low) / 2
    return f"{with_error(low, half)} to {with_error(high, half)}"


def interval_of(bounds: tuple[float, float], recordings: int) -> str:
    """An interval with the number of recordings behind it; none where they are too few."""
    if recordings < FEWEST_FOR_INTERVAL:
        return f"no interval from {counted(recordings, 'recording')}"
    return f"{interval(*bounds)} ({counted(recordings, 'recording')})"


def confidence_interval(bounds: tuple[float, float], recordings: int) -> str:
    """The same with its level, for a tile."""
    text = interval_of(bounds, recordings)
    return text if recordings < FEWEST_FOR_INTERVAL else f"95 %: {text}"


def year_text(year: Mapping[str, Any]) -> str:
    """Energy of a year with its interval and its cost; `year` is `a_year` of an effect in report.json.

    The interval is left out where too few recordings are behind it. Earlier reports did not count the recordings.
    """
    bounds = year["kWh_ci95"] if year.get("recordings", FEWEST_FOR_INTERVAL) >= FEWEST_FOR_INTERVAL else None
    between = f" ({number(bounds[0])} to {number(bounds[1])})" if bounds else ""
    cost = "" if year["EUR"] is None else f", {number(year['EUR'])} EUR"
    return f"{number(year['kWh'])} kWh{between}{cost}"


def unbroken(text: str) -> str:
    """The text with no-break spaces between numbers and their units, and within these, for HTML."""
    return _UNITS_AFTER_NUMBER.sub(lambda found: found[0].replace(" ", "\N{NO-BREAK SPACE}"), text)


def counted(count: int, noun: str) -> str:
    """A count with its noun: 1 recording, 2 recordings."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def duration(seconds: float) -> str:
    """A duration in the unit that suits it."""
    if seconds < 120:
        return f"{number(seconds)} s"
    return f"{number(seconds / 60)} min" if seconds < 7200 else f"{number(seconds / 3600)} h"


def percent(share: float) -> str:
    """A share as a percentage of two significant digits: 4.0 %, 3.9 %, 12 %; nearly all is 99.8 %, not 100 %."""
    if not math.isfinite(share):
        return "-"
    value = 100 * share
    if share >= 1 - _ALL or value < 99.5:
        return f"{number(value, 2)} %"
    return f"{value:.{1 if value < 99.95 else 2}f} %"


def signed_percent(relative: float) -> str:
    """A relative change as a percentage with its sign: +3.9 %."""
    return f"{100 * relative:+z.1f} %"


def quantity(value: float | None, unit: str, digits: int = 5) -> str:
    """A value with the prefix that suits its unit, as 13.367 MW; "-" for None and what is not finite."""
    if value is None or not math.isfinite(value):
        return "-"
    if not value:
        return f"0 {unit}".rstrip()
    size = float(f"{abs(value):.{digits - 1}e}")  # 999999.9 is 1.0000 M
    power = _prefix(size) if unit else 0
    scaled = value / 1000.0**power
    return f"{scaled:.{_decimals(size / 1000.0**power, digits)}f} {_PREFIXES[power]}{unit}".rstrip()


def quantity_with_interval(value: float, half: float, unit: str) -> str:
    """A value and its interval with one prefix, as -81 (-132 to -31) mWh; `half` is half its width."""
    if not (math.isfinite(value) and math.isfinite(half) and half > 0):
        return quantity(value, unit, 3)
    power = _prefix(max(abs(value), half))
    value, half = value / 1000.0**power, half / 1000.0**power
    return f"{with_error(value, half)} ({interval(value - half, value + half)}) {_PREFIXES[power]}{unit}"


def _prefix(size: float) -> int:
    """Power of 1000 of the prefix that suits a positive number."""
    return min(max(math.floor(math.log10(size) / 3), -3), 4)


def _decimals(size: float, digits: int) -> int:
    """Decimals that show so many significant digits of a positive number."""
    exponent = math.floor(math.log10(float(f"{size:.{digits - 1}e}")))
    return min(max(digits - 1 - exponent, 0), _MOST_DECIMALS)
