"""HTML reports of the use case and of the whole reproduction."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import counted, number, percent
from tools.studies.thesis import pictures
from tools.studies.thesis.assembly import CLOSED, NETWORK, Case
from tools.studies.thesis.claims import Claim

HEADER = ("model", "angles", "MAE [W]", "RMSE [W]", "MAE without the peak [W]", "RMSE without the peak [W]")


def table(results: dict[str, Any]) -> list[list[object]]:
    """Rows under HEADER."""
    return [
        [name, kind, *values[kind].values()]
        for name, values in results["models"].items()
        for kind in ("predicted", "simulated")
    ]


def loop_text(results: dict[str, Any]) -> str:
    """Effects that the loop identified, or its verdict."""
    loop = results["loop"]
    effects = ", ".join(f"{e['id']} ({e['where']}, confidence {percent(e['confidence'])})" for e in loop["effects"])
    verdict = str(loop["verdict"]).replace("_", " ")
    return effects if loop["verdict"] == "effects_found" else f"{verdict}{f'; perhaps {effects}' if effects else ''}"


def use_case_page(results: dict[str, Any], case: Case, path: Path) -> None:
    """Write the report of chapter 9 to `path`. Raises UserError."""
    page = Page("Use case: an assembly (thesis chapter 9)", simulated=True)
    page.verdict(_use_case_verdict(results))
    page.figure(pictures.peak_picture(case), "The initial peak, before and after closing the loop.")
    page.text(
        f"{results['executions']} executions, on which no model was trained. "
        + (
            "No effect was fitted on them either. "
            if results["spared"]
            else "The effects of the loop WERE fitted on them, because there are too few to hold any out. "
        )
        + "Predicted: from the logged angles of the robot. Simulated: from the motion of the twin."
    )
    page.table(HEADER, table(results))
    page.text(
        f"The flange of the twin is {1000 * results['end_effector_m']:.0f} mm from the measured one on average. "
        f"The time of the twin is scaled to the pace of the cell by {results['pace']:.3f}."
    )
    page.text(f"Result of the loop: {loop_text(results)}.")
    page.heading("Motion")
    page.figure(
        pictures.motion_picture(case), "Measured and simulated joint angles and flange positions. Thesis Figure 9.3."
    )
    page.heading("Power")
    for name in (NETWORK, CLOSED):
        caption = f"Power by {name}, predicted from measured angles (top) and simulated from the twin's angles (bottom)"
        page.figure(pictures.power_picture(case, name, peak=True), f"{caption}. Thesis Figure 9.4.")
        caption += ", without the initial peak"
        page.figure(pictures.power_picture(case, name, peak=False), f"{caption}. Thesis Figure C.2.")
    page.detail("dataset", case.data.path)
    page.detail("dataset SHA-256", case.data.digest)
    page.write(path)


def _use_case_verdict(results: dict[str, Any]) -> Verdict:
    loop = results["loop"]
    before, after = loop["before"]["rmse"], loop["after"]["rmse"]
    executions = counted(results["executions"], "execution")
    figures = [
        KeyFigure(name, f"{number(values['predicted']['mae'])} W", f"MAE from logged angles; {executions}")
        for name, values in results["models"].items()
    ]
    figures.append(KeyFigure("the loop's error (RMS)", f"{number(before)} → {number(after)} W", "held out"))
    found = loop["verdict"] == "effects_found"
    headline = f"The loop finds what the assembly adds: {loop_text(results)}"
    if not found:
        headline = f"The loop does not say what the assembly adds: {loop_text(results)}"
    return Verdict("found" if found else "open", headline, "", figures)


def thesis_page(
    claims: Sequence[Claim], chapters: Sequence[tuple[str, Path]], took: dict[str, float], path: Path, *, quick: bool
) -> None:
    """Write the report of the reproduction to `path`. Raises UserError."""
    page = Page("The thesis, reproduced", simulated=True)
    judged = [claim.agrees for claim in claims if claim.agrees is not None]
    agree = KeyFigure("statements of the thesis that agree", f"{sum(judged)} of {len(judged)}")
    headline = "The thesis is reproduced" if all(judged) else "Not every statement of the thesis is reproduced"
    if quick:
        headline = "A quick run: every step works, and the figures mean nothing"
    page.verdict(Verdict("fine" if all(judged) and not quick else "open", headline, "", [agree]))
    page.text(
        "All results below are from acqd's virtual laboratory, without a real robot or mains. The thesis measured a "
        "KUKA iiwa. The order of the models and the magnitude of errors can be compared, the exact values cannot."
    )
    if quick:
        page.text("This is a quick run with a tiny campaign and a few epochs. It only shows that every step works.")
    page.heading("Figure by figure")
    words = {True: "agrees", False: "DISAGREES", None: ""}
    header = ("thesis", "statement of the thesis", "reproduced", "agreement")
    page.table(header, [[c.figure, c.thesis, c.here, words[c.agrees]] for c in claims])
    page.heading("Reports of the steps")
    for title, report in chapters:
        page.chapter(title, report)
    page.heading("Run time")
    page.table(("step", "seconds"), [[title, round(seconds)] for title, seconds in took.items()])
    page.write(path)
