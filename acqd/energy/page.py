"""A statement as a self-contained HTML page with pictures."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from acqd.energy.account import Period
from acqd.energy.comparison import Comparison
from acqd.energy.statement import Statement
from acqd.energy.stretches import NWH_PER_KWH
from acqd.energy.tables import exact_kwh, standby_share
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import duration, number, percent, signed_percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_BARS = 400
_BEFORE, _AFTER, _MUTED = "#b45309", "#1d6fa5", "#9aa5b1"


def energy_page(bill: Statement) -> Page:
    """The page, not yet written."""
    page = Page(
        f"Energy of {', '.join(one.device for one in bill.accounts)}",
        simulated=any(one.simulated for one in bill.accounts),
        kind="energy", subject=", ".join(one.device for one in bill.accounts),
    )  # fmt: skip
    page.verdict(_verdict(bill))
    page.text(
        f"From {_shown(bill, bill.chosen.begin)} to {_shown(bill, bill.chosen.end)}, local time of {bill.zone.key}. "
        "Energies are differences of the register, so what rows lack of it is not lost; time without rows is shown, "
        "and never filled."
    )
    page.heading(f"By {bill.by}")
    of = "the periods" if len(bill.periods) <= _MOST_BARS else f"the last {_MOST_BARS} of {len(bill.periods)} periods"
    page.figure(_bars(bill), f"Energy of {of}, and the share of the time without rows")
    page.table(HEADER, [cells(bill, one) for one in bill.periods])
    for account in bill.accounts if len(bill.accounts) > 1 else []:
        page.heading(account.device)
        page.table(HEADER, [cells(bill, one) for one in account.periods])
    page.heading("Check of the sums")
    page.text("The energy of the periods, over gaps, and steps of the register are the register's difference.")
    page.table(
        ["device", "periods [kWh]", "over gaps [kWh]", "register set [kWh]", "register [kWh]"],
        [
            (one.device, *map(exact_kwh, (
                sum(period.nWh or 0 for period in one.periods), one.between_nWh, one.jumps_nWh, one.register_nWh,
            )))
            for one in bill.accounts
        ],
    )  # fmt: skip
    return page


HEADER = ("period", "kWh", "mean", "peak", "15 min", "cost", "CO2", "standby", "without rows")


def cells(bill: Statement, one: Period) -> tuple[str, ...]:
    """A row of the table, on the page and in the terminal."""
    share = standby_share(one)
    missing = one.missing_s if one.missing_s >= 1 else 0.0
    return (
        bill.label(one),
        _energy(one), watts(one.mean_W), watts(one.max_W), watts(one.demand.W if one.demand else None), euros(one),
        emitted(one), "-" if share is None else percent(share),
        duration(missing) if missing else "",
    )  # fmt: skip


def _energy(one: Period) -> str:
    return "-" if one.kWh is None else f"{one.kWh:.3f}"


def watts(power: float | None) -> str:
    """A power in W or kW."""
    if power is None:
        return "-"
    return f"{number(power)} W" if abs(power) < 1000 else f"{number(power / 1000)} kW"


def euros(one: Period) -> str:
    """A cost; a lower bound where energy has no price."""
    return "-" if one.cost is None else f"{'>= ' if one.unpriced_nWh else ''}{float(one.cost):.2f} EUR"


def emitted(one: Period) -> str:
    """Kg CO2; a lower bound where energy has no factor."""
    return "-" if one.co2_kg is None else f"{'>= ' if one.no_co2_nWh else ''}{number(float(one.co2_kg))} kg"


def comparison_text(bill: Statement) -> str:
    """The comparison with the range before, in words."""
    before = bill.before
    if not isinstance(before, Comparison):
        return before
    change = "" if before.change is None else f", {signed_percent(before.change)}"
    why = "" if before.quantity == "kWh" else " (mean power, because rows lack)"
    unit = "kWh" if before.quantity == "kWh" else "W"
    return f"{number(before.before, 4)} {unit} before{change}{why}"


def _verdict(bill: Statement) -> Verdict:
    total, share = bill.total, standby_share(bill.total)
    between = sum(one.between_nWh for one in bill.accounts)
    figures = [KeyFigure("energy", f"{_energy(total)} kWh", comparison_text(bill))]
    if total.cost is not None:
        figures.append(KeyFigure("cost", euros(total), bill.tariff.name if bill.tariff else ""))
    if total.co2_kg is not None:
        figures.append(KeyFigure("CO2", emitted(total)))
    if share is not None and total.standby_nWh is not None:
        figures.append(KeyFigure("standby", percent(share), f"{total.standby_nWh / NWH_PER_KWH:.3f} kWh at rest"))
    capacity = bill.capacity_EUR
    if capacity is not None and bill.tariff is not None:
        figures.append(KeyFigure("capacity", f"{capacity:.2f} EUR", bill.capacity_text))
    remarks = [remark for one in bill.accounts for remark in one.remarks]
    if between:
        remarks.append(f"{exact_kwh(between)} kWh were counted over gaps, and belong to no single period")
    missing = total.missing_s
    if missing >= 60:
        said = f"Rows lack for {duration(missing)}."
        return Verdict("open", f"{_energy(total)} kWh", said, figures, warnings=remarks)
    return Verdict("fine", f"{_energy(total)} kWh", "Rows of the whole time are there.", figures, warnings=remarks)


def _shown(bill: Statement, at: int) -> str:
    return f"{datetime.fromtimestamp(at, bill.zone):%Y-%m-%d %H:%M}"


def _bars(bill: Statement) -> Figure:
    """Energy per period, with what is standby, and below it the share of time without rows."""
    from matplotlib.figure import Figure

    periods = bill.periods[-_MOST_BARS:]
    figure = Figure(figsize=(9, 4.2))
    energy, gaps = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
    place = range(len(periods))
    energy.bar(place, [one.kWh or 0.0 for one in periods], color=_AFTER, label="work")
    if any(one.standby_nWh for one in periods):
        energy.bar(place, [(one.standby_nWh or 0) / NWH_PER_KWH for one in periods], color=_BEFORE, label="standby")
        energy.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    energy.set_ylabel("kWh")
    gaps.bar(place, [100 * one.missing_s / (one.end - one.begin) for one in periods], color=_MUTED)
    gaps.set_ylim(0, 100)
    gaps.set_ylabel("no rows [%]")
    step = max(1, -(-len(periods) // 12))
    labels = [bill.label(one) for one in periods][::step]
    gaps.set_xticks(list(place)[::step], labels, rotation=30, ha="right", fontsize=8)
    for axes in (energy, gaps):
        axes.grid(axis="y", alpha=0.4)
        axes.set_axisbelow(True)
    return figure
