"""The fleet as one self-contained page: what is shared, who has changed, who could not be judged, everybody."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import quote

import numpy as np

from acqd.fleet import words
from acqd.fleet.settings import Fleet
from acqd.fleet.summary import FleetReport, Row
from acqd.report.blocks import Link
from acqd.report.chain import REPORT
from acqd.report.digits import counted, number, percent
from acqd.report.lines import Chart, Line, Panel
from acqd.report.page import Page
from acqd.report.verdict import KeyFigure, Tone, Verdict

_LEAST_P = 1e-12
"""Smaller p-values are drawn here."""
_HEAD = ("robot", "since (UTC)", "what", "how much", "a year", "how sure", "residual [W RMS]")


def page_of(fleet: Fleet, report: FleetReport, out: Path) -> Page:
    """The page, to be written into `out`."""
    simulated = any(row["screen"] and row["screen"]["measured"] == "simulated" for row in report.robots)
    page = Page(f"Fleet {fleet.path.stem}: {counted(len(report.robots), 'robot')}", simulated=simulated, kind="fleet")
    page.verdict(_verdict(report))
    _shared(page, report, out)
    _changed(page, report, out)
    _failed(page, report)
    _statistics(page, report)
    _everybody(page, report, out)
    page.detail("fleet", fleet.path)
    page.detail("seed", fleet.settings.seed)
    return page


def _verdict(report: FleetReport) -> Verdict:
    changed, failed = len(report.changed), report.failed
    tone: Tone = "found" if changed else "bad" if failed else "fine"
    headline = f"{counted(changed, 'robot')} changed" if changed else "No robot has shown a change"
    if not report.tests["robots"]:
        headline = "No robot could be judged"
    if report.shared:
        several = sum(len(each["robots"]) for each in report.shared)
        headline += f", {several} of them for {counted(len(report.shared), 'shared cause')}"
    false = percent(report.tests["false_discoveries"])
    figures = [
        KeyFigure("judged", str(report.tests["robots"]), f"of {len(report.robots)}"),
        KeyFigure("changed", str(changed), f"expected false share at most {false}"),
    ]  # fmt: skip
    if failed:
        figures.append(KeyFigure("failed", str(failed), "see below"))
    steps = [f"look for one reason behind {each['cause']} in {len(each['robots'])} robots" for each in report.shared]
    alone = [row for row in report.changed if row["shared"] is None]
    if alone:
        steps.append(f"open the report of {alone[0]['name']}" + (f" and of {len(alone) - 1} more" if alone[1:] else ""))
    return Verdict(tone, headline, _sentence(report), figures, steps)


def _sentence(report: FleetReport) -> str:
    return " ".join(_sentence_of(words.shared_line(k, each)) for k, each in enumerate(report.shared, start=1))


def _shared(page: Page, report: FleetReport, out: Path) -> None:
    page.heading("Shared causes")
    for k, each in enumerate(report.shared, start=1):
        page.text(f"{_sentence_of(words.shared_line(k, each))} {_sentence_of(each['summary'])}")
        page.text(f"Robots: {', '.join(each['robots'])}.")
        if each["perhaps"]:
            page.text(f"Perhaps too, by their second explanation and their onset: {', '.join(each['perhaps'])}.")
        with page.folded(f"Onset and size of {counted(len(each['robots']), 'robot')}"):
            page.table(_HEAD, [_cells(row, out) for row in report.changed if row["shared"] == k])
        with page.folded(f"Excepted: {counted(len(each['excepted']), 'robot')} without the cause"):
            page.text(", ".join(each["excepted"]) or "none")
    if report.shared:
        page.text(f"Test: {report.shared[0]['test']}.")


def _changed(page: Page, report: FleetReport, out: Path) -> None:
    page.heading("Changed for reasons of their own" if report.shared else "Robots that have changed")
    own = [row for row in report.changed if row["shared"] is None]
    if own:
        page.table(_HEAD, [_cells(row, out) for row in own])
    if report.changed:
        page.text("The name of a robot leads to its closing report.")
    for row in report.changed:
        for note in row["notes"]:
            page.text(_sentence_of(f"{row['name']}: {note}"))


def _cells(row: Row, out: Path) -> list[object]:
    return [
        _linked(row, out), words.since(row), words.what(row), words.how_much(row), words.a_year(row),
        words.how_sure(row), words.residual(row),
    ]  # fmt: skip


def _linked(row: Row, out: Path) -> str | Link:
    """The robot's name, which leads to its closing report, else to the page of its dataset."""
    pages = [Path(row["report"])] if row["report"] else []
    pages += [Path(row["dataset"]) / REPORT] if row["dataset"] else []
    page = next((each for each in pages if each.exists()), None)
    return row["name"] if page is None else Link(row["name"], quote(os.path.relpath(page.resolve(), out.resolve())))


def _sentence_of(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}." if text else ""


def _failed(page: Page, report: FleetReport) -> None:
    page.heading("Robots that could not be judged")
    failed = [[row["name"], str(row["error"])] for row in report.robots if row["state"] == "failed"]
    if failed:
        page.table(["robot", "reason"], failed)


def _statistics(page: Page, report: FleetReport) -> None:
    page.heading("How the changed robots were chosen")
    tests = report.tests
    page.text(
        f"{tests['method'].title()} on {tests['robots']} p-values at a false discovery rate of "
        f"{tests['false_discoveries']:g}. The p-value of a robot is the probability that the CUSUM charts of an "
        "unchanged residual go as far in as much recorded time; q is the smallest rate at which the robot would be "
        "called changed. The confidence of a cause is that of acqd close-loop: that other recordings name it again."
    )
    p = np.sort([row["p"] for row in report.robots if row["p"] is not None])
    if len(p) < 2:
        return
    rank = np.arange(1, len(p) + 1)
    shown = -np.log10(np.maximum(p, _LEAST_P))
    line = tests["false_discoveries"] * rank / len(p)
    lines = [Line("robots", shown, "before"), Line("limit of the rate", -np.log10(line), "muted")]
    last = int(tests["changed"])
    alt = f"Sorted p-values of {len(p)} robots; the first {last} are called changed."
    page.lines(Chart(rank.astype(float), "robots by p-value", [Panel("-log10 p", lines)], alt), alt)


def _everybody(page: Page, report: FleetReport, out: Path) -> None:
    page.heading("All robots")
    with page.folded(f"{counted(len(report.robots), 'robot')} with p-values and residuals"):
        rows = [
            [
                _linked(row, out), row["type"] or "", words.STATES[row["state"]],
                "" if row["p"] is None else words.probability(row["p"]),
                "" if row["q"] is None else words.probability(row["q"]), words.residual(row),
                "" if row["screen"] is None else number(row["screen"]["seconds"] / 60, 2),
            ]
            for row in report.robots
        ]  # fmt: skip
        page.table(["robot", "type", "state", "p", "q", "residual [W RMS]", "recorded [min]"], rows)
