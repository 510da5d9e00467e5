"""The stages as a page: what is done, what to do now, and every line to type."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from acqd.guide.found import Found
from acqd.guide.stages import Stage
from acqd.report.page import Page
from acqd.report.verdict import KeyFigure, Verdict


def write_page(path: Path, found: Found, steps: Sequence[Stage]) -> None:
    """Write the page. Raises UserError."""
    simulated = bool(found.datasets) and all(each.measured == "simulated" for each in found.datasets)
    page = Page(
        f"From the robot to the repaired model: {found.folder.resolve().name}", simulated=simulated, kind="guide"
    )
    page.verdict(_verdict(steps))
    page.heading("Stages")
    page.table(["stage", "state", "what there is, or what to do"], [[s.name, s.state, s.says] for s in steps])
    page.heading("Lines to type")
    page.table(["stage", "line"], [[step.name, command] for step in steps for command in step.commands])
    if found.unread:
        page.heading("Files that were left out")
        page.table(["file"], [[each] for each in found.unread])
    page.write(path)


def _verdict(steps: Sequence[Stage]) -> Verdict:
    done = sum(step.state == "done" for step in steps)
    figures = [KeyFigure("done", f"{done} of {len(steps)} stages")]
    now = next((step for step in steps if step.state == "now"), None)
    if now is None:
        return Verdict("fine", "Nothing is left to do", figures=figures)
    says = f"{now.says[0].upper()}{now.says[1:]}."
    return Verdict("open", f"Next: {now.name}", says, figures, list(now.commands))
