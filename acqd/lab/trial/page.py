"""The page of a trial: the verdict of the loop first, then the truth, then how the verdict came about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from acqd.errors import InputError
from acqd.lab.trial.hidden import Hidden
from acqd.lab.trial.outcome import IN_WORDS, Outcome
from acqd.report.blocks import Link
from acqd.report.digits import interval, number, percent
from acqd.report.head import read_head
from acqd.report.lines import Chart
from acqd.report.page import Page
from acqd.robot.description import load_description

PAGE = "index.html"


@dataclass(frozen=True, slots=True)
class Trial:
    """What a trial has made."""

    folder: Path
    robot: str
    seed: int
    hidden: Hidden
    outcome: Outcome
    steps: Sequence[tuple[str, float | None]]
    """Commands, and the seconds that they took; None for those whose result was there."""
    pages: Sequence[Path]
    """Pages of the steps, the closing report first."""
    following: Sequence[str]
    """Commands to type next."""


def trial_page(trial: Trial, picture: Chart) -> Page:
    """The page, to be written into the folder of the trial. Raises InputError."""
    page = Page(
        f"A trial with {trial.robot}, seed {trial.seed}", simulated=True, kind="trial", subject=trial.robot,
        joints=load_description(trial.robot).joint_names,
    )  # fmt: skip
    page.verdict(read_head(trial.pages[0]).verdict)
    page.text(
        "The loop got rows of power and logs of the robot's joints, as it gets them from a real robot. The robot, its "
        "supply and its meter were simulated; one thing was changed between the two sessions, and nothing told the "
        "loop."
    )
    page.heading("What was hidden")
    hidden = trial.hidden
    at = f" ({hidden.where})" if hidden.where else ""
    page.text(f"The truth: {hidden.change.about}{at}, {hidden.sized}. {IN_WORDS[trial.outcome.answer]}")
    page.table(["", "hidden", "named by the loop", "95 % interval", "interval holds the truth"], _compared(trial))
    page.lines(
        picture,
        "Above, a recording that no fit has seen. Below, the power that the hidden change really took, and what the "
        "loop has added to the model.",
    )
    page.heading("How the verdict came about")
    page.table(["command", "s"], [[line, "" if s is None else f"{s:.0f}"] for line, s in trial.steps])
    page.heading("The pages of the steps")
    page.table(["page", "what", "says"], _pages(trial))
    page.heading("What to type next")
    page.table(["command"], [[line] for line in trial.following])
    page.detail("seed", trial.seed)
    return page


def _compared(trial: Trial) -> list[list[str]]:
    hidden, outcome = trial.hidden, trial.outcome
    named = "; ".join(f"{name} ({where}), {percent(sure)} sure" for name, where, sure in outcome.named) or "nothing"
    rows = [["cause", f"{hidden.change.id}{f' ({hidden.where})' if hidden.where else ''}", named, "", ""]]
    size = outcome.size
    if size is None:
        return [*rows, [hidden.change.parameter, hidden.sized, "", "", ""]]
    bounds = "" if size.ci95 is None else _with_unit(interval(*size.ci95), size.unit)
    holds = {True: "yes", False: "no", None: ""}[size.holds(hidden.size)]
    truth, found = (_with_unit(number(value), size.unit) for value in (hidden.size, size.value))
    return [*rows, [hidden.change.named, truth, found, bounds, holds]]


def _with_unit(text: str, unit: str) -> str:
    return text if unit == "-" else f"{text} {unit}"


def _pages(trial: Trial) -> list[list[str | Link]]:
    rows: list[list[str | Link]] = []
    for path in trial.pages:
        try:
            head = read_head(path)
        except InputError:
            continue
        name = path.relative_to(trial.folder)
        rows.append([Link(str(name), quote(str(name))), head.kind, head.verdict.headline])
    return rows
