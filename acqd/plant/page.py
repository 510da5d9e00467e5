"""The plant as one self-contained page: every device with its alarm, cause, energy and cost of a day."""

from __future__ import annotations

import os
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from urllib.parse import quote

from acqd.plant.device_row import SEVERITIES, DeviceRow
from acqd.plant.plant import Plant
from acqd.report.blocks import Link, Spark
from acqd.report.digits import counted, duration, number, signed_percent
from acqd.report.page import Page
from acqd.report.verdict import KeyFigure, Tone, Verdict

_HEAD = (
    "device", "severity", "state", "cause", "since (UTC)", "kWh a day", "EUR a day", "trend", "without rows",
    "acknowledged by", "report",
)  # fmt: skip
_LOOSE = ("alarm", "what", "since (UTC)", "acknowledged by")
_MOST_STEPS = 3


def plant_page(plant: Plant, out: Path) -> Page:
    """The page, to be written to `out`."""
    title = f"Plant: {counted(len(plant.rows), 'device')}"
    page = Page(title, simulated=plant.simulated, kind="plant")
    page.verdict(_verdict(plant))
    page.heading("Devices")
    page.text(
        f"The gravest first. Energies and costs of a day are means of the last seven days, until "
        f"{datetime.fromtimestamp(plant.end, plant.rules.zone):%Y-%m-%d %H:%M} in {plant.rules.zone.key}; days that "
        "lack more than a hundredth of their rows do not count. The trend is against the same weekdays of the week "
        "before; the line shows both weeks."
    )
    page.table(_HEAD, [cells(row, out) for row in plant.rows], sortable=True)
    if plant.loose:
        page.heading("Alarms of no device in the table")
        page.table(_LOOSE, [_loose(alarm) for alarm in plant.loose])
    tariff = plant.rules.tariff
    page.detail("tariff", tariff.name if tariff is not None else "none: energies have no cost")
    page.detail("zone", plant.rules.zone.key)
    return page


def _verdict(plant: Plant) -> Verdict:
    count = {severity: sum(row.severity == severity for row in plant.rows) for severity in SEVERITIES}
    bad, loose = count["alarm"] + count["no rows"], plant.open_loose
    in_doubt = count["acknowledged"] or plant.loose or plant.heard is None
    tone: Tone = "bad" if bad or loose else "found" if count["changed"] else "open" if in_doubt else "fine"
    figures = [KeyFigure(severity, str(count[severity])) for severity in SEVERITIES if count[severity]]
    known = [row.kWh for row in plant.rows if row.kWh is not None]
    lacking = len(plant.rows) - len(known)
    note = f"of {counted(len(known), 'device')}; {lacking} unknown" if lacking else "of all devices"
    energy = f"{number(sum(known), 4)} kWh" if known else "-"
    figures.append(KeyFigure("energy a day", energy, note if known else "no device has a complete day"))
    costs = [row.EUR for row in plant.rows if row.EUR is not None]
    if costs:
        unknown = len(plant.rows) - len(costs)
        figures.append(KeyFigure("cost a day", f"{number(sum(costs), 4)} EUR", f"{unknown} unknown" if unknown else ""))
    warnings = [plant.trouble] if plant.trouble else []
    if plant.heard is None:
        warnings.append("The broker was not asked: states and alarms are unknown.")
    elif plant.heard.alarms is None:
        warnings.append("acqd alarms does not run on this broker: alarms are what the states of daemons say.")
    away = sorted(name for name, state in plant.heard.sinks.items() if state is None) if plant.heard else []
    warnings += [f"The sink {name} is offline: it stores no rows." for name in away]
    worst = [row for row in plant.rows if row.severity in ("alarm", "no rows")][:_MOST_STEPS]
    steps = [f"{row.device}: {row.cause or row.severity}" for row in worst]
    steps += [f"{alarm.get('key', '')}: {alarm.get('text', '')}" for alarm in loose[:_MOST_STEPS]]
    wrong = [f"{counted(bad, 'device')} without rows or with an open alarm"] if bad else []
    wrong += [f"{counted(len(loose), 'open alarm')} of no device in the table"] if loose else []
    headline = ", ".join(wrong) or ("Alarms are unknown" if plant.heard is None else "No open alarm")
    return Verdict(tone, headline, "", figures, steps, warnings)


def cells(row: DeviceRow, out: Path) -> list[object]:
    """A row of the table."""
    trend = "-" if row.change is None else signed_percent(row.change)
    days = ", ".join("-" if value is None else number(value) for value in row.days)
    return [
        row.device, row.severity, row.state, row.cause, row.since, _or_dash(row.kWh), _or_dash(row.EUR, cents=True),
        Spark(trend, row.days, f"kWh of {len(row.days)} days: {days}"), duration(row.missing_s) if row.missing_s >= 60
        else "", row.acknowledged_by, _link(row, out),
    ]  # fmt: skip


def _loose(alarm: Mapping[str, object]) -> list[object]:
    since = str(alarm.get("since", ""))[:16].replace("T", " ")
    return [str(alarm.get("key", "")), str(alarm.get("text", "")), since, str(alarm.get("acknowledged_by", ""))]


def _or_dash(value: float | None, *, cents: bool = False) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if cents else number(value, 4)


def _link(row: DeviceRow, out: Path) -> str | Link:
    if row.report is None or not Path(row.report).exists():
        return ""
    return Link("report", quote(os.path.relpath(Path(row.report).resolve(), out.resolve().parent)))
