"""What an hour of recordings with 40 minutes of reference costs `acqd close-loop`: CPU time, memory (simulated plant).

    python -m tools.studies.foreign.hour OUT [--case payload-3] [--seed 1901] [--json]

The plant and its cases are those of `tools.studies.foreign`, with more recordings. The command runs in a process of its
own, as a user starts it, pages included. Files and model are not made again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tools.studies.foreign.cases import PLANS, World, cases, make_after
from tools.studies.foreign.generator.motion import Plan
from tools.studies.foreign.runner import Runner
from tools.studies.foreign.steps import StepError, environment

AMOUNT = "hour"
PLANS[AMOUNT] = Plan(20, 120.0), Plan(30, 120.0)
"""40 minutes before, an hour after."""
STRENGTHS = (10, 3, 1)


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one command."""

    cpu_s: float
    """User and system."""
    wall_s: float
    peak_MB: float
    """Largest resident memory."""
    verdict: str
    named: list[str]


def prepared(out: Path, seed: int, name: str) -> tuple[Path, Path]:
    """Dataset in question, and the model of the plant as it was. Raises StepError."""
    world = World(7, seed, AMOUNT, torques=False, own_clocks=False)
    runner = Runner(out, world, "base", None)
    model = runner.prepare()
    case = next((each for each in cases(world.axes, STRENGTHS) if each.name == name), None)
    if case is None:
        raise StepError(f"no case {name}: python -m tools.studies.foreign OUT --list")
    make_after(world, case, runner.data / name)
    dataset = runner.work / "datasets" / name
    if not dataset.exists():
        runner.build(runner.data / name, dataset)
    return dataset, model


def closed(dataset: Path, model: Path, folder: Path) -> Cost:
    """`acqd close-loop` in a process. Raises StepError."""
    command = [sys.executable, "-m", "acqd", "close-loop", dataset, "--model", model, "--out", folder, "--json"]
    began = time.monotonic()
    with tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as complaints:
        process = subprocess.Popen(list(map(str, command)), stdout=said, stderr=complaints, env=environment(None))
        _, status, usage = os.wait4(process.pid, 0)  # of this process alone: training may have taken more
        wall_s = time.monotonic() - began
        texts = [(each.seek(0), each.read())[1] for each in (said, complaints)]
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise StepError(f"acqd close-loop ended with {process.returncode}: {texts[1].strip()[-300:]}")
    report = json.loads(texts[0])
    cpu_s, peak_MB = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6
    named = [effect["id"] for effect in report["effects"]]
    return Cost(round(cpu_s, 1), round(wall_s, 1), round(peak_MB), report["verdict"], named)


def main() -> None:
    """Print what the loop costs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--case", default="payload-3", help="as `tools.studies.foreign --list` prints them")
    parser.add_argument("--seed", type=int, default=1901)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    try:
        dataset, model = prepared(given.out, given.seed, given.case)
        cost = closed(dataset, model, given.out / "loop")
    except StepError as error:
        sys.exit(str(error))
    if given.json:
        values = {name: getattr(cost, name) for name in Cost.__slots__}
        print(json.dumps({"simulated": True, "case": given.case} | values))
        return
    print(f"{given.case} (simulated): {cost.verdict}, named: {', '.join(cost.named) or 'nothing'}")
    print(f"CPU {cost.cpu_s:.0f} s, {cost.wall_s:.0f} s by the clock, at most {cost.peak_MB:.0f} MB")


if __name__ == "__main__":
    main()
