"""Judges `acqd next` on plants that it has never met: does the designed recording bring the right name?

    python -m tools.studies.foreign.second OUT [--only '*-1'] [--cases 30] [--minutes 3] [--long 9]
        [--arm designed --arm random] [--json]

Takes the open cases that `tools.studies.foreign OUT` has judged: one effect of the library is hidden, and the loop
named nothing, or something else, or a family. For each: the motion that `acqd next` designs, also in a third of the
minutes, a D-optimal motion of equal length from the same pieces, and random motion of the generator's kind, also in a
third of the minutes and in `--long` ones. Gears are as warm as the design asks for in the first three, and cold before
random motion, as in the first session. The foreign plant executes each with the same hidden effect, and the loop judges
both sessions together. Right: the effect, without a family. What is there is not made again, so that an interrupted run
continues; a case that acqd names rightly after the first session is left out.

Printed are the right answers by kind and minutes of motion, the least random motion that names as many as a designed
one, and the promises beside the shares that were right. Every cause here is one of the library: what is believed of
something else lowers the promise, and not that "where the cause is known".
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path
from statistics import fmean
from typing import Any

import orjson
from rich.console import Console
from rich.progress import track
from rich.table import Table

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as acqd's commands: small matrices, which threads slow down

from acqd.atomic import write_complete
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.discrepancy.report.summary import as_json
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import OperationError, UserError
from acqd.experiment.design import Asked, Designed, Outlook, next_motion
from acqd.experiment.pieces import motion_of
from acqd.motion.controller import RATE
from acqd.report.digits import percent
from tools.common.tables import show
from tools.studies.foreign.cases import World, cases, make_after, make_second
from tools.studies.foreign.generator import motion as foreign
from tools.studies.foreign.judge import Result, accepts, kind, outcome
from tools.studies.foreign.robustness import world_of
from tools.studies.foreign.runner import Runner, result_files
from tools.studies.foreign.steps import StepError

_CUT_S = 45.0
"""Longest recordings of random motion."""
ARMS = ("designed", "third", "d_optimal", "random", "random_third", "long")
_NAME = {"name": "id", "confidence": "confidence"}
_PROMISED = ("now", "designed", "third", "d_optimal", "random")


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("out", type=Path, metavar="OUT")
    add("--label", default="base", help="folder of the results that are continued (default base)")
    add("--only", action="append", metavar="GLOB", help="cases by name, such as '*-1'")
    add("--cases", type=int, default=30, help="at most so many (default 30)")
    add("--minutes", type=float, default=3.0)
    add("--long", type=float, default=9.0, metavar="MINUTES", help="of random motion (default 9; 0: none)")
    add("--arm", action="append", choices=ARMS, help="only these motions; may be repeated")
    add("--json", action="store_true")
    return parser.parse_args()


def answer(result: Result) -> str:
    """right, wrong or open: what is said without a family."""
    effects = result["report"]["effects"] if result["report"] else []
    if not effects or effects[0]["family"]["members"]:
        return "open"
    return "right" if accepts(result["truth"][0]["id"], effects[0], result["axes"]) else "wrong"


def open_cases(out: Path, label: str, globs: list[str], count: int) -> list[Result]:
    """Judged cases of one effect of the library without the right answer, by turns of their plants."""
    by_plant: dict[str, list[Result]] = {}
    for file in result_files(out, label):
        result = json.loads(file.read_text())
        wanted = not globs or any(fnmatch(result["case"], glob) for glob in globs)
        if wanted and kind(result) == "single" and outcome(result) != "error" and answer(result) != "right":
            by_plant.setdefault(result["world"], []).append(result)
    turns = [each for rank in range(count) for group in by_plant.values() for each in group[rank : rank + 1]]
    return turns[:count]


class Second:
    """The second sessions of one case."""

    def __init__(self, out: Path, label: str, result: Result) -> None:
        self.world: World = world_of(result["world"])
        self.runner = Runner(out, self.world, label, None)
        known = cases(self.world.axes, (10, 3, 1), own_clocks=self.world.own_clocks)
        self.case = next(case for case in known if case.name == result["case"])
        self.result = result
        self.folder = self.runner.work / "second" / self.case.name

    def run(self, minutes: float, long_min: float, arms: Sequence[str]) -> dict[str, Any] | None:
        """What the loop says with every second session; None where nothing is open.

        Raises StepError, UserError, OperationError.
        """
        done = self.folder / f"answers-{minutes:g}-{long_min:g}-{'-'.join(arms)}.json"
        if done.exists():
            return dict(json.loads(done.read_text()))
        truth = make_after(self.world, self.case, self.runner.data / self.case.name)
        first = self.folder / "first"
        self.runner.prepare()
        self._build(self.runner.data / self.case.name, first)
        said = {"now": _said(self._closed(first))}
        if said["now"]["answer"] == "right":
            return None
        begun, begun_s = os.times(), time.perf_counter()
        designed = _designed(first / "loop", minutes)
        ended, wall_s = os.times(), time.perf_counter() - begun_s
        programs = {"designed": (designed, designed.after), "d_optimal": (designed, designed.for_parameters)}
        if "third" in arms:
            third = _designed(first / "loop", minutes / 3)
            programs["third"] = third, third.after
        lengths = {"random": minutes, "random_third": minutes / 3, "long": long_min}
        motions: dict[str, foreign.Motion | foreign.Plan] = {
            **{name: _motion(*program) for name, program in programs.items()},
            **{name: _random(length) for name, length in lengths.items() if length},
        }
        for name, motion in ((name, motions[name]) for name in arms if name in motions):
            session, design = self.folder / name, programs.get(name, (None,))[0]
            worked_min, cut_s = (0.0, _CUT_S) if design is None else (design.worked_min, design.cut_s)
            files = make_second(self.world, self.case, session / "data", truth, name, motion, worked_min)
            self._build(files, session, cut_s, worked_min)
            said[name] = _said(self._closed(first, session))
        promises = programs | {"now": (designed, designed.so_far), "random": (designed, designed.random)}
        true = self.result["truth"][0]["id"]
        row = {
            "world": self.world.name, "case": self.case.name, "seconds": designed.motion.seconds, "said": said,
            "design_cpu_s": ended.user + ended.system - begun.user - begun.system, "design_wall_s": wall_s,
            "promised": {name: outlook.right(design.causes) for name, (design, outlook) in promises.items()},
            "if_true": {name: _if_true(true, *promise) for name, promise in promises.items()},
            "compared": [cause.candidate.id or cause.candidate.label for cause in designed.causes],
            "decides": designed.decides, "begins": "cold" if designed.cold else "warm",
        }  # fmt: skip
        write_complete(done, orjson.dumps(row, option=orjson.OPT_SERIALIZE_NUMPY))
        return row

    def _build(self, files: Path, session: Path, cut_s: float | None = None, worked_min: float = 0.0) -> None:
        if not (session / "ds").exists():
            self.runner.build(files, session / "ds", cut_s, worked_min)

    def _closed(self, first: Path, *second: Path) -> Result:
        """Like a result of the study."""
        folder = (second[0] if second else first) / "loop"
        file = folder / "report.json"
        if not file.exists():
            further = tuple(session / "ds" for session in second)
            config = CloseConfig(first / "ds", self.runner.work / "model", folder, further=further)
            report = as_json(config, close_loop(config, lambda *_: None))
            write_complete(file, orjson.dumps(report, option=orjson.OPT_SERIALIZE_NUMPY))
        return self.result | {"report": json.loads(file.read_text())}


def _said(result: Result) -> dict[str, Any]:
    """The answer, with the first name and its confidence."""
    first = next(iter(result["report"]["effects"]), None)
    named = {key: None if first is None else first[of] for key, of in _NAME.items()}
    return {"answer": answer(result), **named}


def _if_true(cause: str, designed: Designed, outlook: Outlook) -> float:
    """Promised where this is the cause: over its places by what they are believed; 0 where it is not compared."""
    own = [
        (each.believed, named)
        for each, named in zip(designed.causes, outlook.named, strict=True)
        if each.candidate.id == cause
    ]
    return float(sum(share * named for share, named in own) / max(sum(share for share, _ in own), 1e-9))


def _designed(report: Path, minutes: float) -> Designed:
    return next_motion(report, Asked(minutes, share_of_speed=1.0), lambda *_: None)


def _motion(designed: Designed, outlook: Outlook) -> foreign.Motion:
    """The motion of an outlook's pieces, at the generator's step."""
    every = round(RATE * foreign.STEP_S)
    motion = motion_of(designed.space, tuple(step for piece in outlook.pieces for step in piece.steps))
    return foreign.given(*(rows[::every] for rows in (motion.q, motion.qd, motion.qdd)))


def _random(minutes: float) -> foreign.Plan:
    """As many recordings as the loop wants of a designed program, or more."""
    count = max(THRESHOLDS.held_out_every, math.ceil(60 * minutes / _CUT_S))
    return foreign.Plan(count, 60 * minutes / count)


def main() -> None:
    """Print how many open cases every kind of motion resolves."""
    given = options()
    found = open_cases(given.out, given.label, given.only or [], given.cases)
    if not found:
        sys.exit(f"{given.out}: no open cases of one effect under the label {given.label}")
    console, rows, arms = Console(stderr=True), [], given.arm or ARMS
    for result in track(found, "open cases", console=console):
        try:
            row = Second(given.out, given.label, result).run(given.minutes, given.long, arms)
            rows += [] if row is None else [row]
        except (StepError, UserError, OperationError) as error:
            console.print(f"{result['world']} {result['case']}: {error}", highlight=False)
    if given.json:
        print(json.dumps({"simulated": True, "cases": rows}))
        return
    _print(rows, arms, given.minutes, given.long)


def _print(rows: list[dict[str, Any]], arms: Sequence[str], minutes: float, long_min: float) -> None:
    table = Table("case (simulated)", "compared", "now", *arms, "promised now / designed / third / D-optimal / random")
    for row in rows:
        promised = " / ".join(percent(row["promised"][name]) if name in row["promised"] else "-" for name in _PROMISED)
        answers = [row["said"][name]["answer"] if name in row["said"] else "-" for name in ("now", *arms)]
        table.add_row(f"{row['world']} {row['case']}", ", ".join(row["compared"]), *answers, promised)
    show(table, width=200)
    lengths = {"third": minutes / 3, "random_third": minutes / 3, "long": long_min}
    right: dict[str, int] = {}
    for name in ("now", *arms):
        said = [row["said"][name] for row in rows if name in row["said"]]
        counts = Counter(each["answer"] for each in said)
        right[name] = counts["right"]
        length = "" if name == "now" else f" after {lengths.get(name, minutes):.2g} min"
        sure = [each["confidence"] for each in said if each["confidence"] is not None]
        mean = f"; mean confidence of {len(sure)} names {percent(fmean(sure))}" if sure else ""
        print(f"{name}{length}: {counts['right']} right, {counts['wrong']} wrong, {counts['open']} open{mean}")
    for name in _PROMISED:
        both = [row for row in rows if name in row["said"] and name in row["promised"]]
        if both:
            share = sum(row["said"][name]["answer"] == "right" for row in both) / len(both)
            promised, known = (percent(fmean(row[which][name] for row in both)) for which in ("promised", "if_true"))
            print(f"promised {name}: {promised} right, {known} where the cause is known; were {percent(share)}")
    for name in ("designed", "third"):
        if name in right:
            print(minutes_of_random(right, name, lengths, minutes))
    cpu, wall = ([row[f"design_{clock}_s"] for row in rows] for clock in ("cpu", "wall"))
    if rows:
        print(
            f"a program: {fmean(cpu):.0f} s of CPU, {fmean(wall):.0f} s; at most {max(cpu):.0f} and {max(wall):.0f} s"
        )


def minutes_of_random(right: dict[str, int], name: str, lengths: dict[str, float], minutes: float) -> str:
    """The shortest random motion that names as many as a designed one, in a sentence.

    `right`: right answers by kind of motion; `lengths` in minutes, of the others `minutes`.
    """
    tried = sorted((lengths.get(each, minutes), each) for each in ("random", "random_third", "long") if each in right)
    own = lengths.get(name, minutes)
    as_many = next((length for length, each in tried if right[each] >= right[name]), None)
    if as_many is not None:
        return f"{name}, {own:.2g} min: random motion names as many after {as_many:.2g} min, {as_many / own:.2g} times"
    longest = f"; more than {tried[-1][0] / own:.2g} times the minutes" if tried else ""
    return f"{name}, {own:.2g} min: no random motion that was tried names as many{longest}"


if __name__ == "__main__":
    main()
