"""Reports of the use case and of the whole thesis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acqd.report.page import Page
from tools.studies.thesis import pictures
from tools.studies.thesis.assembly import CLOSED, NETWORK, Case
from tools.studies.thesis.claims import Claim

HEADER = ("model", "angles", "MAE [W]", "RMSE [W]", "MAE without the peak", "RMSE without the peak")


def table(found: dict[str, Any]) -> list[list[object]]:
    """Rows under HEADER."""
    return [
        [name, kind, *values[kind].values()]
        for name, values in found["models"].items()
        for kind in ("predicted", "simulated")
    ]


def loop_text(found: dict[str, Any]) -> str:
    """What it named."""
    effects = ", ".join(f"{e['id']} ({e['where']}, confidence {e['confidence']:.0%})" for e in found["loop"]["effects"])
    return effects or str(found["loop"]["verdict"])


def use_case_page(found: dict[str, Any], case: Case, path: Path) -> None:
    """Chapter 9. Raises UserError."""
    page = Page("Use case: an assembly (thesis chapter 9)", simulated=True)
    page.text(
        f"{found['executions']} executions that no model was fitted on"
        + (
            ", nor any effect. "
            if found["spared"]
            else "; the loop's effects WERE fitted on them: too few to spare any. "
        )
        + "Predicted: from the angles that the robot logged; simulated: from the twin's own motion."
    )
    page.table(HEADER, table(found))
    page.text(
        f"The flange of the twin is {1000 * found['end_effector_m']:.0f} mm from the measured one in the mean: "
        f"its time is scaled to the cell's pace ({found['pace']:.3f})."
    )
    page.text(f"What the loop found: {loop_text(found)}.")
    page.figure(pictures.motion_picture(case), "Figure 9.3: measured and simulated angles, and where the flange goes.")
    for name in (NETWORK, CLOSED):
        what = f"power predicted by {name} from measured angles (top) and simulated from the twin's (bottom)"
        page.figure(pictures.power_picture(case, name, peak=True), f"Figure 9.4: {what}.")
        page.figure(
            pictures.power_picture(case, name, peak=False), f"Figure C.2: the same without the initial peak; {name}."
        )
    page.figure(pictures.peak_picture(case), "The initial peak, before and after closing the loop.")
    page.write(path)


def thesis_page(
    claims: Sequence[Claim], chapters: Sequence[tuple[str, Path]], took: dict[str, float], path: Path, *, quick: bool
) -> None:
    """The whole. Raises UserError."""
    page = Page("The thesis, reproduced", simulated=True)
    page.text(
        "Every figure below comes from acqd's virtual laboratory: no robot, no mains. The thesis' figures are of a "
        "real KUKA iiwa. What can be compared is the order of models and the size of errors, not the watts."
    )
    if quick:
        page.text("A quick run with a tiny campaign and a few epochs: it shows that every step works, nothing else.")
    page.heading("Figure by figure")
    words = {True: "as in the thesis", False: "NOT as in the thesis", None: ""}
    page.table(("thesis", "it says", "here", ""), [[c.figure, c.thesis, c.here, words[c.agrees]] for c in claims])
    judged = [claim.agrees for claim in claims if claim.agrees is not None]
    page.text(f"{sum(judged)} of {len(judged)} statements hold here. Chapter 8 prints its numbers as pictures only.")
    page.heading("Every step's own report")
    for title, report in chapters:
        page.chapter(title, report)
    page.heading("What it took")
    page.table(("step", "seconds"), [[title, round(seconds)] for title, seconds in took.items()])
    page.write(path)
