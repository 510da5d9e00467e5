"""The sheet as a self-contained HTML page."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from acqd.conformance.budget import COVERAGE, Budget
from acqd.conformance.limits import LEFT_OUT
from acqd.conformance.point import Point
from acqd.conformance.points.events import example as dips
from acqd.conformance.points.flicker import example as fluctuation
from acqd.conformance.points.states import STATES
from acqd.conformance.sheet import LABEL, Sheet
from acqd.conformance.signal import Signal
from acqd.conformance.terminal import Terminal
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, Bars
from acqd.report.digits import counted, number
from acqd.report.lines import Chart, Colour, Line, Panel

_MOST = 1.5
"""Share of the limit at which a bar ends; beyond it the label tells."""
_PICTURE_POINTS = 1_200


def sheet_page(sheet: Sheet) -> Page:
    """The page, not yet written."""
    name = sheet.terminal.name
    page = Page(f"Conformance sheet of acqd behind {name}", simulated=True, kind="conformance", subject=name)
    page.verdict(_verdict(sheet))
    page.text(LABEL)
    page.text(
        "Every test signal is turned into codes of the terminal, metered, encoded as rows, stored in SQL and read "
        "back. Nothing here is a certificate, and no instrument was on a test bench."
    )
    for point in sheet.failed:
        page.text(f"Failed: {point.standard}, {point.parameter}, {point.quantity}: {point.signal}: {_result(point)}")
    for standard in dict.fromkeys(point.standard for point in sheet.points):
        page.heading(standard)
        points = [point for point in sheet.points if point.standard == standard]
        page.bars(_bars(points), "A longer bar than that of the limit is beyond.")
        page.table(
            ["parameter", "test signal", "quantity", "largest error", "limit", "unit", "readings", "result"],
            [
                (
                    one.parameter, one.signal, one.quantity, _shown(one.error), f"{one.limit.value:g}",
                    one.limit.unit, one.readings, "passed" if one.passed else "FAILED",
                )
                for one in points
            ],
        )  # fmt: skip
        with page.folded("Where the limits are from"):
            page.table(
                ["parameter", "limit", "source"],
                sorted({(one.parameter, f"{one.limit.value:g} {one.limit.unit}", one.limit.source) for one in points}),
            )
    page.heading("Test signals")
    for signal in (STATES[1].signal(sheet.terminal, 0.06), dips(sheet.terminal), fluctuation(sheet.terminal)):
        page.lines(_chart(signal, sheet.terminal), f"{signal.text}; as the terminal samples it.")
    page.heading("Uncertainty of the described box")
    _budgets(page, sheet.budgets)
    page.heading("Left out")
    page.table(["not on this sheet, and why"], [(text,) for text in LEFT_OUT])
    page.heading("Terminal")
    page.table(["key", "value"], [(key, str(value)) for key, value in sheet.terminal.model_dump().items()])
    return page


def _verdict(sheet: Sheet) -> Verdict:
    failed, count = sheet.failed, len(sheet.points)
    worst = max(sheet.points, key=lambda point: point.used)
    beyond = [one for one in sheet.budgets if one.passed is False]
    figures = [
        KeyFigure(
            "points passed", f"{count - len(failed)} of {count}", "" if sheet.complete else "a part of the sheet"
        ),
        KeyFigure("closest to its limit", _percent(worst), f"{worst.parameter}, {worst.quantity}"),
        KeyFigure("terminal", sheet.terminal.name, f"{sheet.terminal.bits} bit, {sheet.terminal.rate:g} samples/s"),
    ]
    if sheet.budgets:
        figures.append(
            KeyFigure("budgets within their limit", f"{len(sheet.budgets) - len(beyond)} of {len(sheet.budgets)}")
        )
    steps = [f"Look at {one.parameter}, {one.quantity}: {_result(one)}" for one in failed[:3]]
    steps += [f"{one.quantity}: {number(one.expanded)} {one.unit} (k = 2) exceed the limit" for one in beyond[:3]]
    if failed:
        return Verdict("bad", f"{counted(len(failed), 'point')} failed", "", figures, steps)
    if beyond:
        headline = "All points passed, and the described box exceeds a limit"
        return Verdict(
            "open", headline, "The method keeps every limit; converter and transformers do not.", figures, steps
        )
    return Verdict("fine", "All points passed", "No point is beyond its limit.", figures, steps)


def _bars(points: list[Point]) -> Bars:
    """The worst point of each parameter and quantity."""
    worst: dict[str, Point] = {}
    for point in points:
        name = f"{point.parameter}: {point.quantity}"
        if name not in worst or point.used > worst[name].used:
            worst[name] = point
    rows = [
        Bar(name, min(one.used, _MOST), _percent(one), "after" if one.passed else "before", one.signal)
        for name, one in worst.items()
    ]
    return Bars([Bar("limit", 1.0, "100 %", "muted"), *rows], "Largest error as a share of the limit")


def _budgets(page: Page, budgets: Iterable[Budget]) -> None:
    empty = True
    for budget in budgets:
        empty = False
        allowed = "no limit is known"
        if budget.limit is not None:
            allowed = f"limit {budget.limit.value:g} {budget.limit.unit}: {'met' if budget.passed else 'EXCEEDED'}"
        expanded = f"{number(budget.expanded)} {budget.unit} (k = {COVERAGE:g})"
        page.text(f"{budget.quantity}: expanded uncertainty {expanded}, {allowed}.")
        page.table(
            ["component", "limit of error", "unit", "sensitivity", f"contribution [{budget.unit}]"],
            [
                (one.name, one.half_width, one.unit, one.sensitivity, one.contribution)
                for one in sorted(budget.components, key=lambda one: -one.contribution)
            ],
        )
    if empty:
        page.text(
            "Neither the converter nor transformers are described: there is no budget. A terminal file with "
            "[uncertainty] and [transformers] gives one (docs/conformance.md)."
        )


def _chart(signal: Signal, terminal: Terminal) -> Chart:
    count = round(signal.seconds * terminal.rate)
    step = max(1, count // _PICTURE_POINTS)
    t = np.arange(0, count, step) / terminal.rate
    samples = signal.wave(t)
    lines = [Line(name, samples[:, 2 * k], colour) for k, (name, colour) in enumerate(_COLOURS)]
    return Chart(t * 1e3, "time [ms]", [Panel("voltage [V]", lines)], f"Voltages of the test signal {signal.text}")


_COLOURS: tuple[tuple[str, Colour], ...] = (("U1", "ink"), ("U2", "before"), ("U3", "after"))


def _result(point: Point) -> str:
    if not point.readings:
        return "no reading"
    return f"{_shown(point.error)} {point.limit.unit}, limit {point.limit.value:g}"


def _shown(error: float) -> str:
    return number(error) if np.isfinite(error) else "missing"


def _percent(point: Point) -> str:
    return f"{number(100 * point.used, 2)} %" if np.isfinite(point.used) else "missing"
