"""`acqd lab investigate`: a hidden change, the loop, the question that it leaves, the motion that decides, the answer.

The command runs the commands that an engineer types, one after the other, and shows each of them. What is there already
is not made again, so that an interrupted circle goes on.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console

from acqd.cli.lab.circle import Circle, report_of
from acqd.cli.lab.options import Undeclared
from acqd.cli.lab.steps import Step, Steps
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import LOOP, MOTION, require

_SHORT = ("--limited", "4", "--all", "0")
"""Recordings after the change: two minutes with the tool down leave small changes open."""
_WARM = ("--worked", 120)
"""The gears of the virtual robot are warm from work; a hidden change may begin with cold ones."""
_CUT_S = "45"
"""Pieces of the designed recording: the loop needs several."""


def investigate(
    out: Annotated[Path, typer.Option(help="Folder of the whole circle; an unfinished one is continued.")],
    undeclared: Undeclared = None,
    robot: Annotated[str, typer.Option(help="Shipped robot, or path of a description.")] = "ur10e",
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the virtual robot.")] = 1,
    minutes: Annotated[float, typer.Option(min=0.5, max=30, help="Longest duration of the designed motion.")] = 3.0,
    json: Json = False,
) -> None:
    """Hide a change in a virtual robot and close the loop, with a designed second recording where one is too few.

    Example: acqd lab investigate --out circle --undeclared payload:mass_kg=0.35
    """
    require("acqd lab investigate", (*LOOP, *MOTION), "lab,loop")
    from acqd.experiment.page import share
    from acqd.lab.effects import check_axes, parse_effect
    from acqd.robot.description import load_description

    if not undeclared:
        raise UserError("--undeclared: name the change to hide, such as payload:mass_kg=0.35 (acqd lab effects)")
    check_axes([parse_effect(text, declared=False) for text in undeclared], load_description(robot).axes)
    circle = Circle(Steps(out, Console(stderr=True)), robot)
    plant = ("--seed", str(seed))
    found = _run(circle, plant, undeclared, minutes)
    if json:
        print(orjson.dumps(found, option=orjson.OPT_INDENT_2).decode())
        return
    screen = terminal()
    screen.print(f"hidden (simulated): {', '.join(undeclared)}")
    screen.print(f"first session: {found['first']}")
    if found["designed"] is None:
        screen.print("no question is left: a second session is not needed")
        return
    promised = found["designed"]["right_name"]
    screen.print(
        f"designed motion: right name {share(promised['now'])} now, {share(promised['designed'])} after it, "
        f"{share(promised['random'])} after random motion"
    )
    if found["both"] is None:
        screen.print("no motion of this length decides: a second session is not recorded")
        return
    screen.print(f"both sessions: {found['both']}")
    screen.print(f"reports: {circle.out / 'after.ds.loop'}, {circle.out / 'after.ds.loop.next'}, {circle.out / 'both'}")


def _run(circle: Circle, plant: tuple[str, ...], undeclared: list[str], minutes: float) -> dict[str, Any]:
    """Beliefs before and after, in words, and what the design promised."""
    from acqd.discrepancy.report.belief import belief

    out, steps = circle.out, circle.steps
    asked = {"undeclared": undeclared, "robot": circle.robot, "plant": [*plant], "minutes": minutes}
    steps.claim("investigate.json", asked, "circle")
    hidden = tuple(word for text in undeclared for word in ("--undeclared", text))
    first = circle.close(("--limited", 4, "--all", 8, *plant), (*_SHORT, *plant, *hidden), _WARM)
    found = {"undeclared": undeclared, "simulated": True, "first": belief(first), "designed": None, "both": None}
    if _settled(first):
        return found
    design = out / "after.ds.loop.next"
    steps.run(Step.of(design / "next.json", "next", circle.loop, "--minutes", minutes, "--limit-speed", 100))
    designed = orjson.loads((design / "next.json").read_bytes())
    if not designed["decides"]:
        return found | {"designed": designed}
    effects = [word.replace("--undeclared", "--effect") for word in hidden]
    executed = out / "executed"
    work_min = designed.get("worked_min")  # a program of an earlier acqd does not ask for any
    worked = ("--worked", work_min) if work_min else ()
    cut = ("--cut", designed.get("cut_s", _CUT_S))
    robot = ("--robot", circle.robot, *plant, *effects, *worked)
    steps.run(Step.of(executed / "report.html", "lab", "execute", design / "motion.csv", "--out", executed, *robot))
    files = executed / "rows.jsonl", executed / "motion.csv"
    steps.run(circle.dataset("second.ds", *files, *cut, *worked))
    sessions = ("close-loop", out / "after.ds", "--with", out / "second.ds")
    steps.run(Step.of(out / "both" / "report.json", *sessions, "--model", circle.model, "--out", out / "both"))
    return found | {"designed": designed, "both": belief(report_of(out / "both"))}


def _settled(report: dict[str, Any]) -> bool:
    """Whether the loop has a name that it does not doubt."""
    from acqd.discrepancy.settled import settled

    return bool(report["effects"]) and all(map(settled, report["effects"]))
