"""Judges `acqd save` on foreign plants: is a predicted saving there, and is its interval honest?

    python -m tools.studies.saving OUT [--programs 3 --plants 1 --robots ur10e fr3 --seconds 40 --amount short --seed 1
        --metered]

The plants share neither equations nor parameters with acqd (tools.studies.foreign). Of each, acqd trains a grey box on
random motion, as a user would. Then pick-and-place programs with other laws of motion are executed, acqd proposes from
their logs, and the plant executes every proposal as the CSV of timed joints says. With `--metered`, original and best
proposal are executed once more with MuJoCo's torques, and metered by the daemon's tasks. All data are simulated.
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.errors import UserError
from acqd.motion.program_text import timed_joints
from acqd.robot.description import load_description
from acqd.saving.proposals import Proposal, savings
from acqd.saving.source import Asked, opened
from tools.common.tables import show
from tools.studies.foreign.cases import World
from tools.studies.foreign.generator.motion import STEP_S
from tools.studies.foreign.runner import Runner
from tools.studies.saving.execution import energy, greatest, replayed, violations, write_log
from tools.studies.saving.metered import metered
from tools.studies.saving.programs import Executed, pick_and_place

_KEY = 44021
"""Distinguishes the random numbers of programs from those of plants."""


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--programs", type=int, default=3, help="per plant")
    parser.add_argument("--first", type=int, default=0, help="number of the first program: others are other programs")
    parser.add_argument("--plants", type=int, default=1, help="per robot")
    parser.add_argument("--robots", nargs="+", default=["ur10e", "iiwa7_r800", "fr3"], help="shipped descriptions")
    parser.add_argument("--seconds", type=float, default=40.0, help="of a program")
    parser.add_argument("--amount", choices=["short", "full"], default="short", help="of recordings to learn from")
    parser.add_argument("--metered", action="store_true", help="the best also by MuJoCo and the daemon's metering")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def judged(runner: Runner, number: int, seconds: float, *, by_daemon: bool) -> list[dict[str, Any]]:
    """All proposals of one program: predicted and measured; `by_daemon`: the best also as `metered` says."""
    done = runner.work / f"program{number}{'-metered' if by_daemon else ''}.json"
    if done.exists():
        return list(json.loads(done.read_text()))
    model, world = runner.prepare(), runner.world
    plant, robot = world.plant(), load_description(world.robot)
    random = np.random.default_rng([world.seed, world.axes, _KEY, number])
    program = pick_and_place(robot, seconds, random)
    log = runner.work / f"program{number}.csv"
    write_log(log, program, plant.signals, random)
    asked = Asked()
    found = savings(opened(model, log, asked), asked, lambda *_: None)
    lines, own = [], greatest(plant, program)
    for block, title in ((found.equal, "equal"), (found.other, "longer")):
        waiting = block.instead.use.seconds - found.equal.instead.use.seconds
        whole = _waiting(program, waiting)
        before = energy(plant, whole, np.ones(len(whole.q)))
        now = block.instead.use.causes
        best = block.proposals[-1].use.energy if block.proposals else None
        executed: dict[
            float, tuple[float, list[str], float | None]
        ] = {}  # the best together is often one of the single changes
        for each in block.proposals:
            longer_s = each.use.seconds - found.before.seconds
            again = each.use.energy in executed
            if not again:
                motion = replayed(timed_joints(each.motion), len(program.q) + round(longer_s / STEP_S))
                brakes = _brakes(each, len(motion.q), signals=plant.signals)
                by_register = None
                if by_daemon and each.use.energy == best:
                    by_register = metered(plant, whole, np.ones(len(whole.q)), random)
                    by_register -= metered(plant, motion, brakes, random)
                executed[each.use.energy] = energy(plant, motion, brakes), violations(plant, motion, own), by_register
            after, broken, by_register = executed[each.use.energy]
            lines.append(
                {
                    "plant": world.name, "program": number, "block": title, "name": each.name,
                    "before_J": before, "predicted_J": each.saving, "half_J": each.half, "measured_J": before - after,
                    "verdict": each.verdict, "violations": broken, "again": again,
                    "metered_J": by_register,
                    "change_J": {cause: used - each.use.causes.get(cause, 0.0) for cause, used in now.items()},
                }
            )  # fmt: skip
    done.write_text(json.dumps(lines))
    return lines


def _waiting(program: Executed, seconds: float) -> Executed:
    rows = round(seconds / STEP_S)
    still = np.zeros((rows, program.q.shape[1]))
    return Executed(
        np.concatenate([program.q, still + program.q[-1]]), np.concatenate([program.qd, still]),
        np.concatenate([program.qdd, still]),
    )  # fmt: skip


def _brakes(proposal: Proposal, rows: int, *, signals: bool) -> np.ndarray:
    """[rows] 0 or 1; the brakes of a robot without a signal stay open."""
    if not signals:
        return np.ones(rows)
    at = np.minimum((np.arange(rows) * STEP_S * 1000).astype(int), len(proposal.motion) - 1)
    return np.asarray(proposal.motion.brake_open[at] * 1.0)


def summary(lines: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures over all programs."""
    known = [each for each in lines if each["half_J"] is not None and not each["again"]]
    within = [abs(each["measured_J"] - each["predicted_J"]) <= each["half_J"] for each in known]
    relative = [(each["measured_J"] - each["predicted_J"]) / each["half_J"] for each in known]
    worse = [each for each in known if each["verdict"] == "saves" and each["measured_J"] < 0]

    def median(block: str, name: str, key: str) -> float:
        of = [each[key] / each["before_J"] for each in lines if each["block"] == block and each["name"] == name]
        return float(np.median(of)) if of else float("nan")

    best = [each for each in lines if each["name"] == "best together"]
    by_daemon = [each for each in known if each["metered_J"] is not None]
    plants = [each["plant"] for each in known]
    return {
        "programs": len({(each["plant"], each["program"]) for each in lines}),
        "proposals": len(known), "within_interval": sum(within), "coverage": float(np.mean(within)) if known else None,
        "coverage_error": _jackknife(np.array(within), plants), "one_plant_correlation": _alike(known, plants),
        "coverage_by_robot": _shares(within, [plant.split("-")[0] for plant in plants]),
        "coverage_by_plant": _shares(within, plants),
        "error_in_half_widths_rms": float(np.sqrt(np.mean(np.square(relative)))) if known else None,
        "median_half_width": float(np.median([each["half_J"] / each["before_J"] for each in known])) if known else None,
        "said_to_save": sum(each["verdict"] == "saves" for each in known), "of_these_worse": len(worse),
        "unprovable": sum(each["verdict"] == "unprovable" for each in known),
        "best_within_interval": sum(abs(each["measured_J"] - each["predicted_J"]) <= each["half_J"] for each in best),
        "metered_within_interval": sum(abs(e["metered_J"] - e["predicted_J"]) <= e["half_J"] for e in by_daemon),
        "metered": len(by_daemon), "best": len(best),
        "limits_violated": sum(bool(each["violations"]) for each in lines),
        "median_saving": {
            "equal, best": median("equal", "best together", "measured_J"),
            "equal, plain slowing into the waits": median("equal", "plain slowing into the waits", "measured_J"),
            "longer, best": median("longer", "best together", "measured_J"),
            "longer, plain uniform slowing": median("longer", "plain uniform slowing", "measured_J"),
        },
    }  # fmt: skip


def _shares(within: list[bool], groups: list[str]) -> dict[str, float]:
    """Share of `within` in every group."""
    return {
        name: float(np.mean([one for one, group in zip(within, groups, strict=True) if group == name]))
        for name in sorted(set(groups))
    }


def _jackknife(within: np.ndarray, plants: list[str]) -> float | None:
    """Standard error of the share of `within`, by leaving out one plant at a time: its errors go the same way."""
    names = sorted(set(plants))
    if len(names) < 2:
        return None
    without = [float(within[[each != name for each in plants]].mean()) for name in names]
    return float(np.sqrt((len(names) - 1) * np.var(without)))


def _alike(known: list[dict[str, Any]], plants: list[str]) -> float | None:
    """Intraclass correlation of the errors, in half intervals, of proposals on one plant (Fisher 1925)."""
    errors: dict[str, list[float]] = {}
    for each, plant in zip(known, plants, strict=True):
        errors.setdefault(plant, []).append((each["measured_J"] - each["predicted_J"]) / each["half_J"])
    groups = [np.array(some) for some in errors.values() if len(some) > 1]
    if len(groups) < 2:
        return None
    size = float(np.mean([len(some) for some in groups]))
    inside = float(np.mean([some.var(ddof=1) for some in groups]))
    between = float(np.var([some.mean() for some in groups], ddof=1)) - inside / size
    return between / (between + inside)


def main() -> None:
    """Print a line per program and the figures."""
    given = options()
    worlds = [
        World(load_description(robot).axes, given.seed + k, given.amount, torques=False, own_clocks=False, arm=robot)
        for robot, k in product(given.robots, range(given.plants))
    ]
    lines: list[dict[str, Any]] = []
    tasks = list(product(worlds, range(given.first, given.first + given.programs)))
    for world, number in track(tasks, "programs", console=Console(stderr=True)):
        runner = Runner(given.out.resolve(), world, "saving", None)
        try:
            lines += judged(runner, number, given.seconds, by_daemon=given.metered)
        except UserError as error:
            print(f"{world.name}, program {number}: {error}")
    if given.json:
        print(json.dumps({"proposals": lines, "summary": summary(lines)}))
        return
    table = Table(
        "plant (simulated)", "program", "cycle", "proposal", "predicted", "90 %", "measured", "metered", "said"
    )
    for each in lines:
        share = [100 * each[key] / each["before_J"] for key in ("predicted_J", "half_J", "measured_J")]
        table.add_row(
            each["plant"], str(each["program"]), each["block"], each["name"], f"{share[0]:.2f} %",
            f"+-{share[1]:.2f} %", f"{share[2]:.2f} %",
            "" if each["metered_J"] is None else f"{100 * each['metered_J'] / each['before_J']:.2f} %", each["verdict"],
        )  # fmt: skip
    show(table, width=150)
    for name, value in summary(lines).items():
        print(f"{name}: {value}")


if __name__ == "__main__":
    main()
