"""Judges `acqd close-loop` on plants that it has never met (simulated by a generator that imports nothing of acqd).

    python -m tools.studies.foreign OUT --robot 7 --strength 10 --amount full --seeds tune [--jobs 2] [--json]

Every case has recordings before and after; effects are hidden in those after. acqd gets power rows, logs and a
description that is 10 to 20 % wrong. The loop runs in the study's processes; `--acqd TREE` runs the commands of a
source tree, pages included (with `--label`, so that its results lie beside the others). Results that are there are not
made again; generated files are shared by all labels.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from rich.console import Console

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as acqd's commands: small matrices, which threads slow down

from tools.common.tables import show
from tools.studies.foreign.cases import PLANS, ROBOTS, STRENGTHS, Case, World, cases
from tools.studies.foreign.judge import outcome
from tools.studies.foreign.picture import draw
from tools.studies.foreign.runner import Runner, result_files
from tools.studies.foreign.steps import StepError, judged_tree
from tools.studies.foreign.tables import changes, reliability, row, summary, tables

FIRST_SEED = {"tune": 1, "test": 1001}
"""Thresholds are tuned on the plants of one list only, and judged on the other."""
_WIDTH = 190


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("out", type=Path, metavar="OUT")
    add("--robot", type=int, choices=list(ROBOTS), default=7, help="number of axes (default 7)")
    add("--strength", type=int, choices=STRENGTHS, action="append", help="%% of the dynamic range (default all)")
    add(
        "--amount",
        choices=list(PLANS),
        default="full",
        help="10 x 120 s before and 8 after; 5 x 60 s each; 4 x 15 s after",
    )
    add("--torque", action="store_true", help="log joint torques (7 axes) and motor currents")
    add("--clocks", action="store_true", help="clocks of robot and meter differ (default: they agree, --lag 0)")
    add("--harsh", action="store_true", help="sites that keep to no assumption: other loads, motion, friction, meter")
    add("--seeds", choices=list(FIRST_SEED), default="tune")
    add("--first", type=int, metavar="SEED", help="seed of the first plant (default 1 of tune, 1001 of test)")
    add("--worlds", type=int, default=1, help="number of plants (default 1)")
    add("--only", action="append", metavar="GLOB", help="cases by name, such as 'clean-*' or 'payload-10'")
    add("--jobs", type=int, default=1, help="cases at the same time (default 1)")
    add("--acqd", type=Path, metavar="TREE", help="judge the commands of a source tree")
    add("--label", default="base", help="folder of the results of this acqd (default base)")
    add("--again", action="store_true", help="train again and run again what has results")
    add("--show", action="store_true", help="only the tables of all results in OUT under this label")
    add("--against", metavar="LABEL", help="also list the cases that another label judges otherwise")
    add("--picture", type=Path, metavar="FILE", help="also draw the reliability diagram (.png or .svg)")
    add("--list", action="store_true", help="print the names of the cases")
    add("--json", action="store_true")
    return parser.parse_args()


def chosen(given: argparse.Namespace) -> list[Case]:
    """The cases that were asked for."""
    found = cases(given.robot, tuple(given.strength or STRENGTHS), own_clocks=given.clocks)
    return [case for case in found if not given.only or any(fnmatch(case.name, glob) for glob in given.only)]


def run_all(runners: list[Runner], wanted: list[Case], jobs: int) -> list[dict[str, Any]]:
    """Results in the order of plants and cases."""
    console = Console(stderr=True)
    ready = []
    for runner in runners:
        try:
            runner.prepare()
            ready.append(runner)
        except StepError as error:
            console.print(f"{runner.world.name}: {error}", highlight=False)
    done: dict[tuple[str, str], dict[str, Any]] = {}
    with ProcessPoolExecutor(jobs) as pool:
        pending = [pool.submit(runner.run, case) for runner in ready for case in wanted]
        for count, future in enumerate(as_completed(pending), start=1):
            result = future.result()
            done[result["world"], result["case"]] = result
            console.print(
                f"{count} of {len(pending)}: {result['world']} {result['case']}: {outcome(result)}", highlight=False
            )
    return [done[runner.world.name, case.name] for runner in ready for case in wanted]


def main() -> None:
    """Run the study and print its tables."""
    given = options()
    wanted = chosen(given)
    if given.list:
        print("\n".join(case.name for case in wanted))
        return
    if given.show:
        report(stored(given.out, given.label), given)
        return
    first = given.first or FIRST_SEED[given.seeds]
    worlds = [
        World(given.robot, seed, given.amount, given.torque, given.clocks, given.harsh)
        for seed in range(first, first + given.worlds)
    ]
    Console(stderr=True).print(f"judging {judged_tree(given.acqd)}", highlight=False)
    runners = [Runner(given.out.resolve(), world, given.label, given.acqd) for world in worlds]
    if given.again:
        for runner in runners:
            runner.forget(wanted)
    results = run_all(runners, wanted, given.jobs)
    report(results, given)
    if len(results) < len(runners) * len(wanted):
        sys.exit(1)


def stored(out: Path, label: str) -> list[dict[str, Any]]:
    """All results in OUT under a label."""
    return [json.loads(path.read_text()) for path in result_files(out, label)]


def report(results: list[dict[str, Any]], given: argparse.Namespace) -> None:
    """Print results, and what they are worth together."""
    if given.picture:
        draw(reliability(results), given.picture)
    if given.json:
        print(json.dumps({"summary": summary(results), "rows": [row(result) for result in results]}))
        return
    show(*tables(results), width=_WIDTH)
    if given.against:
        show(changes(results, stored(given.out, given.against), given.against), width=_WIDTH)


if __name__ == "__main__":
    main()
