"""`acqd lab investigate`: a hidden change, the loop, the question that it leaves, the motion that decides, the answer.

The command runs the commands that an engineer types, one after the other, and shows each of them. What is there already
is not made again, so that an interrupted circle goes on.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console

from acqd.cli.lab.options import Undeclared
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import OperationError, UserError
from acqd.extras import LOOP, require

_SHORT = ("--limited", "4", "--all", "0")
"""Recordings after the change: two minutes with the tool down leave small changes open."""
_MODEL = "grey-box-everything-s1"
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
    require("acqd lab investigate", LOOP, "lab,loop")
    from acqd.lab.effects import parse_effect

    if not undeclared:
        raise UserError("--undeclared: name the change to hide, such as payload:mass_kg=0.35 (acqd lab effects)")
    for text in undeclared:
        parse_effect(text, declared=False)
    circle = _Circle(
        out, robot, seed, Console(stderr=True), [word for text in undeclared for word in ("--undeclared", text)]
    )
    found = circle.run(undeclared, minutes)
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
        f"designed motion: right name {promised['now']:.0%} now, {promised['designed']:.0%} after it, "
        f"{promised['random']:.0%} after random motion"
    )
    if found["both"] is None:
        screen.print("no motion of this length decides: a second session is not recorded")
        return
    screen.print(f"both sessions: {found['both']}")
    screen.print(f"reports: {circle.out / 'after.ds.loop'}, {circle.out / 'after.ds.loop.next'}, {circle.out / 'both'}")


class _Circle:
    """The commands of the circle for one virtual robot."""

    def __init__(self, out: Path, robot: str, seed: int, console: Console, hidden: list[str]) -> None:
        self.out, self._robot, self._console, self._hidden = out, robot, console, hidden
        self._plant = ("--robot", robot, "--seed", str(seed))

    def run(self, undeclared: list[str], minutes: float) -> dict[str, Any]:
        """Beliefs before and after, in words, and what the design promised."""
        from acqd.discrepancy.report.belief import belief

        out = self.out
        self._require_same(
            {"undeclared": undeclared, "robot": self._robot, "plant": [*self._plant], "minutes": minutes}
        )
        self._once(
            "before/report.html", "lab", "campaign", "--out", out / "before", "--limited", 4, "--all", 8, *self._plant
        )
        self._once("after/report.html", "lab", "campaign", "--out", out / "after", *_SHORT, *self._plant, *self._hidden)
        for name in ("before", "after"):
            self._dataset(f"{name}.ds", out / name / "power.sqlite", out / name / "logs")
        model = out / "before.ds.models" / _MODEL
        self._once(f"before.ds.models/{_MODEL}", "train", out / "before.ds", "--network", "grey-box")
        self._once("after.ds.loop/report.json", "close-loop", out / "after.ds", "--model", model)
        first = _report(out / "after.ds.loop")
        found = {"undeclared": undeclared, "simulated": True, "first": belief(first), "designed": None, "both": None}
        if _settled(first):
            return found
        design = out / "after.ds.loop.next"
        self._once(
            "after.ds.loop.next/next.json", "next", out / "after.ds.loop", "--minutes", minutes, "--limit-speed", 100
        )
        designed = orjson.loads((design / "next.json").read_bytes())
        if not designed["decides"]:
            return found | {"designed": designed}
        effects = [word.replace("--undeclared", "--effect") for word in self._hidden]
        executed = out / "executed"
        self._once(
            "executed/report.html", "lab", "execute", design / "motion.csv", "--out", executed, *self._plant, *effects
        )
        self._dataset("second.ds", executed / "rows.jsonl", executed / "motion.csv", "--cut", _CUT_S)
        self._once(
            *("both/report.json", "close-loop", out / "after.ds", "--with", out / "second.ds", "--model", model),
            *("--out", out / "both"),
        )
        return found | {
            "designed": designed, "both": belief(_report(out / "both")),
        }  # fmt: skip

    def _require_same(self, asked: dict[str, Any]) -> None:
        """What is there belongs to one question. Raises UserError for another one."""
        file, wanted = self.out / "investigate.json", orjson.dumps(asked, option=orjson.OPT_INDENT_2)
        if file.exists() and file.read_bytes() != wanted:
            raise UserError(f"{self.out} holds another circle ({file.name} says which); choose another --out")
        if self.out.exists() and not file.exists() and any(self.out.iterdir()):
            raise UserError(f"{self.out} is not empty and holds no circle; choose another --out")
        self.out.mkdir(parents=True, exist_ok=True)
        file.write_bytes(wanted)

    def _dataset(self, name: str, power: Path, logs: Path, *more: object) -> None:
        words = ("--power", power, "--logs", logs, "--robot", self._robot, "--out", self.out / name, *more)
        self._once(f"{name}/manifest.json", "dataset", "build", *words)

    def _once(self, made: str, *words: object) -> None:
        """Run a command unless what it makes is there. Raises UserError, OperationError with the command's own line."""
        if (self.out / made).exists():
            return
        line = [str(word) for word in words]
        self._console.print(f"acqd {' '.join(line)}", soft_wrap=True, highlight=False)
        done = subprocess.run(
            [sys.executable, "-P", "-m", "acqd", *line, "--json"], capture_output=True, text=True, check=False
        )
        if done.returncode:
            said = (done.stderr.strip().splitlines() or ["no message"])[-1].removeprefix("acqd: ")
            raise (UserError if done.returncode == 2 else OperationError)(f"acqd {line[0]}: {said}")


def _report(folder: Path) -> dict[str, Any]:
    report: dict[str, Any] = orjson.loads((folder / "report.json").read_bytes())
    return report


def _settled(report: dict[str, Any]) -> bool:
    """Whether the loop has a name that it does not doubt."""
    from acqd.experiment.question import settled

    return bool(report["effects"]) and all(map(settled, report["effects"]))
