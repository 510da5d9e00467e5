"""The statistics of EN 50160: shares of values within their limits, and events by class."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.en50160 import limits
from acqd.en50160.read import Period, Series

_TEN_MINUTES_S, _TEN_S, _TWO_HOURS_S = 600, 10, 7_200


@dataclass(frozen=True, slots=True)
class Statistic:
    """One requirement in one channel."""

    characteristic: str
    channel: str
    requirement: str
    """In words, with its limits."""
    unit: str
    values: int
    """That count."""
    left_out: int
    """Flagged with an event, or not whole."""
    incomplete: int
    """Of these, those that are not whole."""
    expected: int
    """Of the whole period."""
    within: float
    """Share of the values within the limits; NaN without values."""
    demanded: float
    """Share that must be."""
    low: float
    """Smallest value."""
    high: float
    """Largest value."""
    p95: float
    """Not exceeded by 95 % of the values."""

    @property
    def covered(self) -> float:
        """Share of the period whose values are known, those with events included."""
        return min(1.0, (self.values + self.left_out - self.incomplete) / self.expected) if self.expected else 0.0

    @property
    def met(self) -> bool | None:
        """Whether the requirement is met; None without values."""
        return None if not self.values else self.within >= self.demanded


@dataclass(frozen=True, slots=True)
class EventClass:
    """Events of one class."""

    kind: str
    voltage: str
    """% of the reference."""
    counts: list[int]
    """By classes of duration."""


def statistics_of(period: Period, declared: float, f_nominal: float) -> list[Statistic]:
    """All requirements. `declared` [V] is Un."""
    seconds = (period.end - period.begin).total_seconds()
    tens = round(seconds / _TEN_MINUTES_S)
    found = list(_frequency(period, f_nominal, round(seconds / _TEN_S)))
    for channel in period.channels:
        found += _voltage(period.series("10min", "Vrms", channel), channel, declared, tens)
    for channel in period.channels:
        flicker = period.series("Plt", "Plt", channel)
        words = f"Plt of 2 h: up to {limits.PLT:g} for 95 %"
        found.append(
            _judged("flicker", channel, words, "", flicker, (0, limits.PLT), 0.95, round(seconds / _TWO_HOURS_S))
        )
    if len(period.channels) == 3:
        unbalance = period.series("10min", "V_u2", "total")
        words = f"u2 of 10 min: up to {limits.UNBALANCE:g} % for 95 %"
        found.append(_judged("unbalance", "total", words, "%", unbalance, (0, limits.UNBALANCE), 0.95, tens))
    for channel in period.channels:
        thd = period.series("10min", "V_thds", channel)
        words = f"THD of 10 min: up to {limits.THD:g} % for 95 %"
        found.append(_judged("THD", channel, words, "%", thd, (0, limits.THD), 0.95, tens))
        found += _harmonics(period.series("10min", "V_h", channel), channel, tens)
    return found


def _frequency(period: Period, nominal: float, expected: int) -> Iterator[Statistic]:
    channel = "total" if len(period.channels) > 1 else "L1"
    series = period.series("10s", "f", channel)
    share = limits.FREQUENCY
    words = f"f of 10 s: within {100 * share:g} % for {100 * limits.FREQUENCY_SHARE:g} % (of a year)"
    bounds = (nominal * (1 - share), nominal * (1 + share))
    yield _judged("frequency", channel, words, "Hz", series, bounds, limits.FREQUENCY_SHARE, expected)
    low, high = limits.FREQUENCY_ALWAYS
    words = f"f of 10 s: {100 * (low - 1):g} % to {100 * (high - 1):+g} % always"
    yield _judged("frequency", channel, words, "Hz", series, (nominal * low, nominal * high), 1.0, expected)


def _voltage(series: Series, channel: str, declared: float, expected: int) -> Iterator[Statistic]:
    for (low, high), demanded in ((limits.VOLTAGE, limits.SHARE), (limits.VOLTAGE_ALWAYS, 1.0)):
        share = "always" if demanded == 1 else f"for {100 * demanded:g} %"
        words = f"Vrms of 10 min: {100 * (low - 1):g} % to {100 * (high - 1):+g} % of {declared:g} V {share}"
        bounds = (low * declared, high * declared)
        yield _judged("voltage", channel, words, "V", series, bounds, demanded, expected)


def _harmonics(series: Series, channel: str, expected: int) -> Iterator[Statistic]:
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = 100 * series.values / series.values[:, :1] if len(series.values) else np.zeros((0, 50))
    for order, limit in sorted(limits.HARMONICS.items()):
        one = Series(series.seconds, shares[:, order - 1], series.event, series.incomplete)
        words = f"H{order} of 10 min: up to {limit:g} % for 95 %"
        yield _judged("harmonics", channel, words, "%", one, (0, limit), 0.95, expected)


def _judged(
    characteristic: str, channel: str, words: str, unit: str, series: Series, bounds: tuple[float, float],
    demanded: float, expected: int,
) -> Statistic:  # fmt: skip
    usable = series.usable if len(series.values) else np.zeros(0, dtype=bool)
    values: Floats = series.values[usable] if len(series.values) else np.zeros(0)
    within = float(((values >= bounds[0]) & (values <= bounds[1])).mean()) if len(values) else float("nan")
    low, high, p95 = (
        (float(values.min()), float(values.max()), float(np.percentile(values, 95)))
        if len(values)
        else (float("nan"),) * 3
    )
    left_out, incomplete = int((series.event | series.incomplete).sum()), int(series.incomplete.sum())
    counts = len(values), left_out, incomplete, expected
    return Statistic(characteristic, channel, words, unit, *counts, within, demanded, low, high, p95)


def event_classes(period: Period) -> list[EventClass]:
    """Events that have ended, by residual voltage (or highest voltage) and duration."""
    table = []
    for low, high in limits.SWELLS:
        table.append(
            _class(period, ("swell",), low, high, f"{100 * low:g} and more" if high > 2 else _range(low, high))
        )
    for low, high in limits.RESIDUAL:
        table.append(_class(period, ("dip", "interruption"), low, high, _range(low, high)))
    return table


def _range(low: float, high: float) -> str:
    return f"{100 * low:g} to {100 * high:g}"


def _class(period: Period, kinds: tuple[str, ...], low: float, high: float, voltage: str) -> EventClass:
    counts = [0] * len(limits.DURATIONS_S)
    for event in period.events:
        if event["kind"] not in kinds or event["duration"] is None:
            continue
        if event["kind"] == "dip" and _is_interrupted(period, event):
            continue  # the interruption within it is counted
        if low <= event["extreme"] / event["reference"] < high:
            for k, (above, up_to) in enumerate(limits.DURATIONS_S):
                counts[k] += above < event["duration"] <= up_to
    return EventClass(kinds[0] if len(kinds) == 1 else "dip, interruption", voltage, counts)


def _is_interrupted(period: Period, dip: Mapping[str, Any]) -> bool:
    begin, end = dip["filetime"], dip["filetime"] + dip["duration"] * 1e7
    return any(one["kind"] == "interruption" and begin <= one["filetime"] <= end for one in period.events)


def as_json(statistic: Statistic) -> dict[str, Any]:
    """Plain data; unknown numbers are null."""
    plain = {name: None if value != value else value for name, value in asdict(statistic).items()}
    return plain | {"covered": statistic.covered, "met": statistic.met}
