"""Energy of the work as a self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import duration, percent, quantity
from acqd.work.cycle_energy import Cycle, CycleEnergy
from acqd.work.labels import Labelled
from acqd.work.tables import CYCLE_HEADER, KIND_HEADER, LABEL_HEADER, cycle_cells, kind_cells, kinds, label_cells

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_CYCLES = 500
_USUAL, _OUTLIER = "#1d6fa5", "#b45309"


def cycles_page(title: str, energy: CycleEnergy, *, simulated: bool) -> Page:
    """The page of cycles, not yet written."""
    page = Page(f"Energy of cycles: {title}", simulated=simulated, kind="energy", subject=title.partition(",")[0])
    page.verdict(_cycles_verdict(energy))
    page.text(
        "Cycles are found in the joint angles alone: the same path, again and again, from the moment at which the arm "
        "leaves its longest rest. Together with what lies between them they are all the measured energy."
    )
    if energy.cycles:
        page.figure(_course(energy.cycles), "Energy of every cycle in its order; crosses: outliers.")
        page.heading("Cycles")
        page.table(KIND_HEADER, [kind_cells(kind, cycles) for kind, cycles in kinds(energy).items()])
    page.heading("Outside of cycles")
    page.table(
        ("", "time", "energy", "mean"),
        [
            (each.name, duration(each.seconds), quantity(1000 * each.kWh, "Wh", 3),
             quantity(3.6e6 * each.kWh / each.seconds, "W", 3))
            for each in energy.between
        ],
    )  # fmt: skip
    outliers = [each for each in energy.cycles if each.outlier]
    if outliers:
        page.heading("Outliers")
        page.table(CYCLE_HEADER, [cycle_cells(each) for each in outliers[:_MOST_CYCLES]])
        page.text(
            "The cause is the largest of three parts of the difference from the median cycle: time at rest, time in "
            "motion, power in motion. A warm-up is more power in motion while that power falls from cycle to cycle."
        )
    if energy.cycles:
        page.heading("Every cycle")
        with page.folded(f"The first {min(len(energy.cycles), _MOST_CYCLES)} cycles"):
            page.table(CYCLE_HEADER, [cycle_cells(each) for each in energy.cycles[:_MOST_CYCLES]])
    return page


def labels_page(title: str, by: str, values: Sequence[Labelled], *, simulated: bool) -> Page:
    """The page of a label, not yet written."""
    page = Page(f"Energy by {by}: {title}", simulated=simulated, kind="energy", subject=title.partition(",")[0])
    whole = sum(each.kWh for each in values)
    most = max(values, key=lambda each: each.kWh)
    seconds = sum(each.seconds for each in values)
    headline = f"Most energy: {by} {most.name}, {percent(most.kWh / whole) if whole else '-'}"
    page.verdict(
        Verdict("fine", headline, "", [KeyFigure("measured", quantity(1000 * whole, "Wh", 4), duration(seconds))])
    )
    page.heading(f"By {by}")
    page.table((by, *LABEL_HEADER), [label_cells(each) for each in values])
    return page


def _cycles_verdict(energy: CycleEnergy) -> Verdict:
    measured = KeyFigure("measured", quantity(1000 * energy.kWh, "Wh", 4), f"in {duration(energy.seconds)}")
    if not energy.cycles:
        return Verdict("open", "No cycles: the motion does not repeat", "", [measured])
    outliers = sum(bool(each.outlier) for each in energy.cycles)
    figures = [measured]
    for kind, cycles in list(kinds(energy).items())[:3]:
        kwh = np.array([each.kWh for each in cycles])
        spread = percent(float(kwh.std(ddof=1) / kwh.mean()))
        mean = quantity(1000 * float(kwh.mean()), "Wh", 3)
        figures.append(KeyFigure(f"a cycle of path {kind}", mean, f"± {spread}"))
    outside = sum(each.kWh for each in energy.between)
    figures.append(
        KeyFigure("outside of cycles", percent(outside / energy.kWh) if energy.kWh else "-", "of the energy")
    )
    return Verdict("fine", f"{len(energy.cycles)} cycles, {outliers} of them outliers", "", figures)


def _course(cycles: Sequence[Cycle]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 2.8), layout="constrained")
    axes = figure.subplots()
    kwh = 1000 * np.array([each.kWh for each in cycles])
    odd = np.array([bool(each.outlier) for each in cycles])
    number = np.arange(1, len(kwh) + 1)
    axes.plot(number[~odd], kwh[~odd], ".", ms=4, color=_USUAL)
    axes.plot(number[odd], kwh[odd], "x", ms=6, mew=2, color=_OUTLIER)
    axes.set_xlabel("cycle")
    axes.set_ylabel("energy [Wh]")
    axes.set_ylim(bottom=min(0.0, 1.1 * float(kwh.min())), top=1.1 * float(kwh.max()))
    return figure
