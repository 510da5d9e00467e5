"""Energy by part, program, step or state as a self-contained HTML page with a picture."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING
from zoneinfo import ZoneInfo

from acqd.energy.by_mark import ByMark, Marked
from acqd.energy.periods import Range
from acqd.energy.stretches import NWH_PER_KWH
from acqd.energy.tables import exact_kwh
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import duration, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_BARS = 30
_VALUE, _OTHERS = "#1d6fa5", "#9aa5b1"
NOTHING = "nothing"
"""Of the time without a mark."""


def mark_page(
    found: Sequence[ByMark], by: str, chosen: Range, zone: ZoneInfo, without_rows: Sequence[str] = ()
) -> Page:
    """The page, not yet written. `without_rows`: devices that have marks and are not shown."""
    devices = ", ".join(one.device for one in found)
    page = Page(
        f"Energy by {by} of {devices}", simulated=any(one.simulated for one in found), kind="energy", subject=devices
    )
    page.verdict(_verdict(found, by))
    page.text(
        f"From {_shown(chosen.begin, zone)} to {_shown(chosen.end, zone)}, local time of {zone.key}. A visit is the "
        f"time from a mark to the next one. The register is cut at the first row whose window begins after a mark."
    )
    if without_rows:
        page.text(f"Without rows in this time, and not shown: {', '.join(without_rows)}.")
    for one in found:
        page.heading(f"{one.device}, {one.channel}")
        page.figure(_bars(one, by), f"Energy, and energy of a visit by {by}")
        page.table([by, *COLUMNS], [cells(each) for each in one.values])
    page.heading("Check of the sums")
    page.text("The energy of the values, over gaps, and steps of the register are the register's difference.")
    page.table(
        ["device", "values [kWh]", "over gaps [kWh]", "register set [kWh]", "register [kWh]"],
        [
            (one.device, *map(exact_kwh, (
                sum(each.nWh for each in one.values), one.between_nWh, one.jumps_nWh, one.register_nWh,
            )))
            for one in found
        ],
    )  # fmt: skip
    return page


COLUMNS = ("visits", "time", "kWh", "kWh a visit", "EUR", "without rows")


def cells(each: Marked) -> tuple[str, ...]:
    """A row of the table, on the page and in the terminal."""
    missing = each.seconds - each.known_s
    cost = "-" if each.cost is None else f"{'>= ' if each.unpriced_nWh else ''}{float(each.cost):.2f}"
    return (
        each.name or NOTHING, str(each.visits), duration(each.seconds), f"{each.kWh:.6f}",
        f"{each.kWh / each.visits:.6f}", cost, duration(missing) if missing >= 1 else "",
    )  # fmt: skip


def _verdict(found: Sequence[ByMark], by: str) -> Verdict:
    total = sum(each.nWh for one in found for each in one.values)
    worked = sum(each.nWh for one in found for each in one.values if each.name)
    costs = [each.cost for one in found for each in one.values if each.cost is not None]
    missing = sum(max(each.seconds - each.known_s, 0.0) for one in found for each in one.values)
    between = sum(one.between_nWh for one in found)
    figures = [KeyFigure("energy", f"{total / NWH_PER_KWH:.3f} kWh")]
    if total > 0:
        figures.append(KeyFigure(f"with a {by}", percent(worked / total), f"{worked / NWH_PER_KWH:.3f} kWh"))
    if costs:
        unpriced = any(each.unpriced_nWh for one in found for each in one.values)
        figures.append(KeyFigure("cost", f"{'>= ' if unpriced else ''}{float(sum(costs)):.2f} EUR"))
    remarks = []
    if between:
        remarks.append(
            f"{exact_kwh(between)} kWh were counted where rows lack, over the end of a visit: no {by} has them"
        )
    if any(one.jumps_nWh for one in found):
        remarks.append("The register was exchanged or set; those steps are no energy.")
    title = f"{total / NWH_PER_KWH:.3f} kWh"
    if missing >= 60:
        return Verdict("open", title, f"Rows lack for {duration(missing)}.", figures, warnings=remarks)
    return Verdict("fine", title, "Rows of the whole time are there.", figures, warnings=remarks)


def _shown(at: int, zone: ZoneInfo) -> str:
    return f"{datetime.fromtimestamp(at, zone):%Y-%m-%d %H:%M}"


def _bars(one: ByMark, by: str) -> Figure:
    """The values with the most energy, and the others together."""
    from matplotlib.figure import Figure

    values = sorted(one.values, key=lambda each: -each.nWh)
    chosen, others = values[:_MOST_BARS], values[_MOST_BARS:]
    names = [each.name or NOTHING for each in chosen] + ([f"{len(others)} others"] if others else [])
    whole = [each.kWh for each in chosen] + ([sum(each.kWh for each in others)] if others else [])
    visit = [each.kWh / each.visits for each in chosen] + ([float("nan")] if others else [])
    figure = Figure(figsize=(9, 1.2 + 0.26 * len(names)))
    energy, a_visit = figure.subplots(1, 2, sharey=True)
    colours = [_VALUE if each.name else _OTHERS for each in chosen] + [_OTHERS] * bool(others)
    for axes, widths, label in ((energy, whole, "kWh"), (a_visit, visit, "kWh a visit")):
        axes.barh(range(len(names)), widths, color=colours)
        axes.set_xlabel(label)
        axes.locator_params(axis="x", nbins=4)  # small numbers are long words
        axes.grid(axis="x", alpha=0.4)
        axes.set_axisbelow(True)
    shown = [name if len(name) <= 24 else f"{name[:23]}…" for name in names]
    energy.set_yticks(range(len(names)), shown, parse_math=False)  # a name with two $ is no formula
    energy.set_ylabel(by)
    energy.invert_yaxis()
    return figure
