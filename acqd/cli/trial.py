"""`acqd try`: a robot, a hidden change and the verdict in the browser, by one command and without a server.

The commands of the circle run one after the other and are shown. What is there already is not made again: an
interrupted trial goes on, and a finished one only shows its page.
"""

from __future__ import annotations

import os
import shlex
import sys
import time
import webbrowser
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console

from acqd.cli.lab.circle import Circle
from acqd.cli.lab.steps import Steps
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.extras import LOOP, MOTION, require

_ROBOT = "iiwa7_r800"
_BEFORE, _AFTER = ("--limited", 4, "--all", 8), ("--limited", 4, "--all", 4)
"""Recordings of about a minute, for a model with intervals and for a name."""
_ROBOT_SEED, _SESSION = 1, 1000
"""One robot for all trials; sessions after the change have seeds from here on, so that no motion is repeated."""
_CLAIM, _SETTINGS = "trial.json", "hidden.toml"
_LATER = "2021-07-20T08:00:00Z"
"""The session after the change, a week after the first."""


def trial(
    out: Annotated[Path | None, typer.Option(help="Folder of the trial (default acqd-try-SEED).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Draws the hidden change: another seed, another change.")] = 1,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Show the page in the browser.")] = True,
    json: Json = False,
) -> None:
    """Measure a simulated robot, hide a change in it, find the cause, and show verdict and truth in the browser.

    All data are simulated. Takes about two minutes on two free cores.

    Example: acqd try --seed 2
    """
    require("acqd try", (*LOOP, *MOTION), "lab,loop")
    from acqd.atomic import write_complete
    from acqd.lab.trial.hidden import drawn

    folder = out or Path(f"acqd-try-{seed}")
    console = Console(stderr=True)
    started, cpu_s = time.monotonic(), _cpu_s()
    circle = Circle(Steps(folder, console), _ROBOT)
    hidden = drawn(seed)
    circle.steps.claim(_CLAIM, {"seed": seed, "robot": _ROBOT}, "trial")
    write_complete(folder / _SETTINGS, _settings(hidden).encode())
    before = (*_BEFORE, "--seed", _ROBOT_SEED)
    after = (*_AFTER, "--seed", _SESSION + seed, "--robot-seed", _ROBOT_SEED, "--settings", folder / _SETTINGS)
    report = circle.close(before, after)
    told = _show(circle, seed, hidden, report)
    told |= {"seconds": round(time.monotonic() - started, 1), "cpu_seconds": round(_cpu_s() - cpu_s, 1)}
    page = Path(told["page"])
    if json:
        print(orjson.dumps(told).decode())
        return
    _print(told)
    if browser and _has_browser():
        webbrowser.open(page.absolute().as_uri())
    elif browser:
        terminal().print(f"open {page.absolute().as_uri()} in a browser: there is none on this terminal's display")


def _settings(hidden: Any) -> str:
    """The laboratory's settings of the session after the change."""
    effect = hidden.effect
    values = ", ".join(f"{name} = {value!r}" for name, value in effect.values.items())
    return (
        "# what acqd try hides: do not look before the verdict\n"
        f'start = {_LATER}\neffects = [{{ id = "{effect.id}", values = {{ {values} }}, declared = false }}]\n'
    )


def _show(circle: Circle, seed: int, hidden: Any, report: dict[str, Any]) -> dict[str, Any]:
    """Write the page; what the command tells."""
    from acqd.atomic import write_complete
    from acqd.discrepancy.report.belief import belief
    from acqd.discrepancy.settled import settled
    from acqd.lab.trial.outcome import IN_WORDS, outcome
    from acqd.lab.trial.page import PAGE, Trial, trial_page
    from acqd.lab.trial.picture import picture
    from acqd.report.chain import connect

    out, found = circle.out, outcome(hidden, report)
    pages = [out / name / "report.html" for name in ("after.ds.loop", "before.ds", "after.ds", "before", "after")]
    following = _following(circle, seed, sure=bool(report["effects"]) and all(map(settled, report["effects"])))
    steps = [(line, circle.steps.seconds.get(line)) for line in circle.steps.lines]
    tried = Trial(out, circle.robot, seed, hidden, found, steps, pages, following)
    drawing = picture(out / "after.ds", circle.model, circle.loop / "model", out / "after.truth")
    write_complete(out / PAGE, trial_page(tried, drawing).html().encode())
    connect(out / PAGE, [pages[0]])
    size = found.size
    return {
        "simulated": True, "seed": seed, "verdict": report["verdict"], "belief": belief(report),
        "hidden": {"id": hidden.change.id, "where": hidden.where, hidden.change.parameter: hidden.size},
        "answer": found.answer, "answer_in_words": IN_WORDS[found.answer],
        "size": None if size is None else {
            "value": size.value, "unit": size.unit, "ci95": size.ci95, "holds": size.holds(hidden.size)
        },
        "page": str(out / PAGE), "files": _files(circle), "next": following,
    }  # fmt: skip


def _following(circle: Circle, seed: int, *, sure: bool) -> list[str]:
    """Commands that go on from here."""
    loop, log = circle.loop, next(iter(sorted((circle.out / "after" / "logs").rglob("*.*"))), None)
    lines = [] if sure else [["next", loop]]
    if log is not None:
        lines.append(["predict", loop / "model", log, "--out", circle.out / "predicted.csv"])
    lines += [
        ["energy", "causes", loop / "model", circle.out / "after.ds", "--html", circle.out / "causes.html"],
        ["reports", circle.out],
        ["try", "--seed", seed + 1],
    ]
    return [shlex.join(["acqd", *map(str, words)]) for words in lines]


def _files(circle: Circle) -> dict[str, str]:
    out = circle.out
    return {
        str(out / "index.html"): "verdict and truth",
        str(circle.loop / "report.html"): "the closing report, and in this folder the repaired model",
        str(circle.model): "the model of the robot in good order",
        str(out / "before.ds"): "rows and logs of the first session, merged",
        str(out / "after.ds"): "the same of the session after the change",
        str(out / "before"): "rows (power.sqlite) and logs as measured; after/ likewise",
        str(out / "after.truth"): "the truth of the laboratory",
    }


def _print(told: dict[str, Any]) -> None:
    console = terminal()
    console.print(f"verdict (simulated power): {told['belief']}")
    sizes = [f"{key} {value}".strip() for key, value in told["hidden"].items() if key != "id" and value != ""]
    console.print(f"hidden: {told['hidden']['id']}, {', '.join(sizes)}")
    console.print(told["answer_in_words"])
    for path, what in told["files"].items():
        console.print(f"  {path}: {what}")
    for line in told["next"]:
        console.print(f"next: {line}")
    console.print(f"{told['seconds']:.0f} s, of the processors {told['cpu_seconds']:.0f} s")
    console.print(f"page: {told['page']}")


def _cpu_s() -> float:
    """Processor time of this process and of the commands that have ended, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _has_browser() -> bool:
    """Whether there is a screen: in a terminal alone, a browser of text would take the terminal."""
    if sys.platform == "linux":
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True
