"""The report of a week as a self-contained HTML page."""

from __future__ import annotations

import math

import numpy as np

from acqd.en50160 import limits
from acqd.en50160.read import Period, Series
from acqd.en50160.statistics import EventClass, Statistic
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, Bars
from acqd.report.digits import counted, number
from acqd.report.lines import Chart, Colour, Line, Panel

_COLOURS: tuple[Colour, ...] = ("ink", "before", "after")
_DAY_S = 86_400.0


def week_page(period: Period, statistics: list[Statistic], events: list[EventClass], declared: float) -> Page:
    """The page, not yet written."""
    page = Page(
        f"Supply voltage of {period.device}, EN 50160",
        simulated=period.simulated,
        kind="EN 50160",
        subject=period.device,
    )
    page.verdict(_verdict(period, statistics, events))
    page.text(
        f"From {period.begin:%Y-%m-%d %H:%M} to {period.end:%Y-%m-%d %H:%M} UTC. Values flagged with a dip, swell or "
        "interruption, or not of a whole interval, are left out of the statistics (IEC 61000-4-30, 4.7). The report "
        "says what was measured; it is no measurement by class A unless the instrument is (docs/conformance.md)."
    )
    page.heading("Requirements")
    shown = [one for one in statistics if one.characteristic != "harmonics"]
    page.table(_HEADER, [_row(one) for one in shown])
    page.heading("Voltage and frequency")
    page.lines(_chart(period, "10min", "Vrms", period.channels, f"voltage [V], Un {declared:g} V"), "Vrms of 10 min")
    channel = "total" if len(period.channels) > 1 else "L1"
    if len(period.series("10s", "f", channel).seconds):
        page.lines(_chart(period, "10s", "f", [channel], "frequency [Hz]"), "f of 10 s")
    page.heading("Harmonics")
    page.bars(
        _harmonic_bars(statistics), "The worst channel of each order; a longer bar than that of the limit is beyond."
    )
    page.lines(_chart(period, "10min", "V_thds", period.channels, "THD [%]"), "THD of 10 min")
    with page.folded("All harmonics"):
        page.table(_HEADER, [_row(one) for one in statistics if one.characteristic == "harmonics"])
    page.heading("Events")
    page.table(
        ["kind", "voltage [% of the reference]", *(_duration(low, high) for low, high in limits.DURATIONS_S)],
        [(one.kind, one.voltage, *one.counts) for one in events],
    )
    return page


_HEADER = ["characteristic", "channel", "requirement", "within", "95 %", "lowest", "highest", "values", "left out", ""]


def _row(one: Statistic) -> tuple[object, ...]:
    state = {True: "met", False: "NOT MET", None: "no values"}[one.met]
    share = "" if math.isnan(one.within) else f"{100 * one.within:.2f} %"
    numbers = ["" if math.isnan(x) else f"{number(x, 4)} {one.unit}" for x in (one.p95, one.low, one.high)]
    return (
        one.characteristic, one.channel, one.requirement, share, *numbers, f"{one.values} of {one.expected}",
        one.left_out, state,
    )  # fmt: skip


def _verdict(period: Period, statistics: list[Statistic], events: list[EventClass]) -> Verdict:
    missed = [one for one in statistics if one.met is False]
    unknown = sorted({one.characteristic for one in statistics if one.met is None})
    voltage = [one for one in statistics if one.characteristic == "voltage"]
    covered = min((one.covered for one in voltage), default=0.0)
    days = (period.end - period.begin).total_seconds() / _DAY_S
    figures = [
        KeyFigure("requirements met", f"{sum(one.met is True for one in statistics)} of {len(statistics)}"),
        KeyFigure("known", f"{100 * covered:.1f} %", f"of {days:g} days, by 10 min values of the voltage"),
        KeyFigure("events", str(sum(sum(one.counts) for one in events)), "dips, interruptions and swells"),
    ]
    steps = [f"{one.characteristic} {one.channel}: {one.requirement}: {100 * one.within:.2f} %" for one in missed[:3]]
    steps += [f"No values of {name}: is it enabled in [quality]?" for name in unknown]
    if missed:
        return Verdict("bad", f"{counted(len(missed), 'requirement')} of EN 50160 not met", "", figures, steps)
    if covered < limits.COMPLETE or days < 7 or unknown:
        sentence = "What is known keeps every limit, but it is not a whole week of all characteristics."
        return Verdict("open", "No complete week", sentence, figures, steps)
    return Verdict("fine", "All requirements of EN 50160 are met", "", figures, steps)


def _chart(period: Period, aggregation: str, name: str, channels: list[str], label: str) -> Chart:
    """Lines over the days; values that do not count are gaps."""
    series: list[Series] = [period.series(aggregation, name, channel) for channel in channels]
    seconds = np.unique(np.concatenate([one.seconds for one in series]))
    lines = []
    for one, channel, colour in zip(series, channels, _COLOURS, strict=False):
        values = np.full(len(seconds), np.nan)
        values[np.searchsorted(seconds, one.seconds)] = np.where(one.usable, one.values, np.nan)
        lines.append(Line(channel, values, colour))
    return Chart(seconds / _DAY_S, f"days since {period.begin:%Y-%m-%d %H:%M} UTC", [Panel(label, lines)], label)


def _harmonic_bars(statistics: list[Statistic]) -> Bars:
    """The worst channel of each order."""
    rows = []
    for order, limit in sorted(limits.HARMONICS.items()):
        mine = [one for one in statistics if one.requirement.startswith(f"H{order} ") and one.values]
        if mine:
            worst = max(mine, key=lambda one: one.p95)
            shown = f"{number(worst.p95)} of {limit:g} %"
            rows.append(Bar(f"H{order}", worst.p95 / limit, shown, "after" if worst.met else "before", worst.channel))
    return Bars(
        [Bar("limit", 1.0, "", "muted"), *rows],
        "Value that 95 % of the 10 min values do not exceed, as a share of its limit",
    )


def _duration(low: float, high: float) -> str:
    if math.isinf(high):
        return f"more than {low:g} s"
    return f"up to {high:g} s" if low == 0 else f"{low:g} to {high:g} s"
