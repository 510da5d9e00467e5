"""A balance as a self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acqd.balance.balance import Balance, Span
from acqd.balance.pictures import energy_flows, power_by_cause
from acqd.balance.rows import Rows
from acqd.models.effects.cause import Cause
from acqd.models.yearly import Yearly
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import (
    FEWEST_FOR_INTERVAL,
    duration,
    interval,
    number,
    percent,
    quantity,
    quantity_with_interval,
)

_MOST_SPANS = 100
_CONSTANT = 1e-6
"""Relative width of an interval of a power that does not change."""
_NOTHING = 1e-6
"""Share of the measured energy below which a cause is shown as zero."""
_HEADER = ("cause", "energy", "mean power", "share", "a year", "95 % interval", "cost a year")
_SOURCES = {
    "simulated": "simulated",
    "derived": "derived from other measurements",
    "mains": "metered",
    "bus": "of the robot's DC bus",
}


def balance_page(
    title: str, balance: Balance, rows: Rows, years: dict[Cause, Yearly], measured: str, joints: Sequence[str] = ()
) -> Page:  # fmt: skip
    """The page, not yet written; `measured`: origin of the power; `joints`: names."""
    total = balance.total
    page = Page(
        f"Energy by cause: {title}",
        simulated=measured == "simulated", kind="energy", subject=title.partition(",")[0], joints=joints,
    )  # fmt: skip
    page.verdict(_verdict(total, years))
    page.text(
        f"The power is {_SOURCES.get(measured, measured)}. All energies are at the meter: a mechanical watt counts "
        "with the loss of the drives that the model gives it. The parts add up to the prediction, and with the "
        "residual to the measured energy. Potential and kinetic energy are stored: over a closed motion they are zero."
    )
    page.figure(
        energy_flows(total, balance.axes),
        "Where the energy goes. What braking and lowering joints give back enters the supply again.",
    )
    page.heading("Causes")
    page.table(_HEADER, _causes(total, years))
    curve, recording = power_by_cause(rows)
    page.heading("Power by cause")
    page.figure(curve, f"The minute with the largest mean power, in {recording}. Below zero: given back.")
    page.heading("Joints")
    page.table(*_joints(total, balance.axes))
    page.text(
        "Over a closed motion the potential and kinetic energy of all joints together is zero; a single joint may do "
        "net work on the others through the arm."
    )
    page.table(("given back by joints", "energy"), _given_back(total))
    page.heading("Parts of the model")
    page.table(
        ("part", "cause", "energy", "mean power"),
        [(e.name, e.cause.value, *_sizes(e.kWh, total.seconds)) for e in total.entries],
    )
    if len(balance.spans) > 1:
        page.heading(f"By {balance.by}")
        causes = list(total.by_cause())
        page.table(
            (balance.by, "measured", "mean", *(cause.value for cause in causes), "residual"),
            [
                (
                    each.label, *_sizes(each.measured, each.seconds),
                    *(_shown(each.by_cause()[cause]) for cause in causes), residual_text(each),
                )
                for each in balance.spans[:_MOST_SPANS]
            ],
        )  # fmt: skip
        if len(balance.spans) > _MOST_SPANS:
            page.text(f"{len(balance.spans) - _MOST_SPANS} more are in the CSV file and in the JSON.")
    return page


def residual_text(span: Span) -> str:
    """The residual with its interval."""
    if span.residual_half is None:
        return f"{_shown(span.residual)} (no interval)"
    return quantity_with_interval(1000 * span.residual, 1000 * span.residual_half, "Wh")


def year_texts(one: Yearly | None) -> tuple[str, str, str]:
    """Energy, interval and cost of a year; of stored energy nothing."""
    if one is None:
        return "stored", "", ""
    bounds = one.bounds
    known = bounds is not None and one.recordings >= FEWEST_FOR_INTERVAL
    shown = "no interval"
    if known and bounds is not None:
        shown = f"{interval(*bounds)} kWh" if bounds[1] - bounds[0] > _CONSTANT * abs(one.kWh) else "constant"
    return f"{number(one.kWh)} kWh", shown, "-" if one.EUR is None else f"{one.EUR:.2f} EUR"


def _shown(kwh: float) -> str:
    return quantity(1000 * kwh, "Wh", 3)


def share_text(kwh: float, total: Span) -> str:
    """Share of the measured energy."""
    share = kwh / total.measured
    return percent(share if abs(share) > _NOTHING else 0.0)


def _sizes(kwh: float, seconds: float) -> tuple[str, str]:
    return _shown(kwh), quantity(3.6e6 * kwh / seconds, "W", 3)


def _causes(total: Span, years: dict[Cause, Yearly]) -> list[tuple[str, ...]]:
    rows = [
        (cause.value, *_sizes(kwh, total.seconds), share_text(kwh, total),
         *year_texts(years.get(cause)))
        for cause, kwh in total.by_cause().items()
    ]  # fmt: skip
    rows.append(("residual", *_sizes(total.residual, total.seconds), "", "", residual_text(total), ""))
    return [*rows, ("measured", *_sizes(total.measured, total.seconds), percent(1.0), "", "", "")]


def _joints(total: Span, axes: int) -> tuple[list[str], list[list[str]]]:
    """Header and rows: energy of every cause by joint."""
    header = ["cause", *(f"joint {k + 1}" for k in range(axes)), "none"]
    rows = []
    for cause in total.by_cause():
        joints = np.sum([each.joints for each in total.entries if each.cause == cause], axis=0)
        rows.append(
            [cause.value, *(_shown(float(kwh) if abs(kwh) > _NOTHING * total.measured else 0.0) for kwh in joints)]
        )
    return header, rows


def _given_back(total: Span) -> list[tuple[str, str]]:
    returned = total.returned
    sizes = {
        "in all": float(returned.joints.sum()), "to other joints at the same moment": returned.to_joints,
        "to what the robot takes beside its drives": returned.to_electronics,
        "burnt in the brake resistor": returned.burnt, "fed to the mains": returned.to_mains,
    }  # fmt: skip
    return [(name, _shown(kwh)) for name, kwh in sizes.items()]


def _verdict(total: Span, years: dict[Cause, Yearly]) -> Verdict:
    consumed = [each for each in total.by_cause().items() if not each[0].stored]
    causes = sorted(consumed, key=lambda each: -each[1])
    largest = [f"{cause.value} {percent(kwh / total.measured)}" for cause, kwh in causes[:3]]
    figures = [
        KeyFigure("measured", quantity(1000 * total.measured, "Wh", 4), f"in {duration(total.seconds)}"),
        KeyFigure("residual", _shown(total.residual), _of_measured(total)),
    ]
    for cause, _ in causes[:3]:
        energy, bounds, cost = year_texts(years[cause])
        known = f"95 %: {bounds}" if bounds.endswith("kWh") else bounds
        figures.append(KeyFigure(f"{cause.value}, a year", energy, known if cost == "-" else f"{cost}; {known}"))
    duty = next(iter(years.values())).duty
    return Verdict(
        "fine", f"Most energy goes into {', '.join(largest)}",
        f"A year: the robot moves {percent(duty)} of the time, as in these recordings or as --duty says.", figures,
    )  # fmt: skip


def _of_measured(total: Span) -> str:
    """The residual's interval as a share of the measured energy."""
    if total.residual_half is None:
        return "no interval from fewer than five blocks"
    low, high = (100 * (total.residual + side * total.residual_half) / total.measured for side in (-1, 1))
    return f"95 %: {interval(low, high)} % of the measured energy"
