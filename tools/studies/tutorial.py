"""How often the intervals of the first ten minutes hold the truth: the page's payload on other robots.

    python -m tools.studies.tutorial OUT [--seeds 20] [--first-seed 2] [--one-robot]

Every seed is another robot of the same kind: other masses, other centres of mass, and torque sensors whose scale has an
error of the size that the loop assumes. It is measured in good order, modelled, measured again with 1.5 kg at its
flange, as on docs/first-ten-minutes.md, and the loop closes on that. With --one-robot all sessions share the page's
robot and its model: then the sizes scatter less than their intervals say, because what a model of that robot has
wrong is the same in all of them. All data are simulated. What is there already is not made again. A 95 % interval of
mass or centre of mass should hold the truth on 95 % of the robots.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from acqd.cli.lab.circle import Circle, report_of
from acqd.cli.lab.steps import Step, Steps
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.lab.plant.mechanics import PAYLOAD_CENTRE_M
from acqd.report.digits import percent

MASS_KG = 1.5
TRUTH = {"mass": MASS_KG, "centre_of_mass_m": PAYLOAD_CENTRE_M}
BEFORE = ("--limited", 4, "--all", 8)
AFTER = ("--limited", 4, "--all", 4, "--undeclared", f"payload:mass_kg={MASS_KG}")
_FIRST_SEED = 2
_PAGE = 1
"""Seed of the page's robot."""
_MOTION_SEED = 1000
"""Added to the seed of a robot: the motions after the change are not those before it."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A session."""

    seed: int
    named: str
    sizes: dict[str, tuple[float, list[float]]]
    """Value and 95 % interval by parameter, of a payload only."""

    def holds(self, name: str) -> bool | None:
        """Whether the interval holds the truth; None without one."""
        if name not in self.sizes:
            return None
        low, high = self.sizes[name][1]
        return low <= TRUTH[name] <= high


def judged(seed: int, report: dict[str, Any]) -> Judged:
    """The sizes of a report.json that names a payload, alone or beside others."""
    named = ", ".join(f"{each['id']} ({each['where']})" for each in report["effects"]) or report["verdict"]
    payload = next((each for each in report["effects"] if each["id"] == "payload"), None)
    if payload is None:
        return Judged(seed, named, {})
    parameters = payload["parameters"]
    sizes = {
        name: (parameters[name]["value"], parameters[name]["ci95"])
        for name in TRUTH
        if name in parameters and parameters[name]["ci95"]
    }
    return Judged(seed, named, sizes)


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot, with its folder."""

    circle: Circle
    seed: int
    torque_scale: float
    """Torques that its sensors log over the true ones."""

    @classmethod
    def of(cls, out: Path, seed: int, torque_scale: float, console: Console) -> Robot:
        """The robot of a seed, in the folder `out`."""
        out.mkdir(parents=True, exist_ok=True)
        (out / "lab.toml").write_text(f"[recorder]\ntorque_scale = {torque_scale!r}\n")
        return cls(Circle(Steps(out, console), "iiwa7_r800"), seed, torque_scale)

    @property
    def model(self) -> Path:
        """Bundle of the robot in good order."""
        return self.circle.out / "model"

    def reference(self) -> None:
        """Measure the robot in good order, and model it."""
        self._measured("before", self.seed, BEFORE)
        words = ("train", self.circle.out / "before.ds", "--network", "grey-box", "--out", self.model)
        self.circle.steps.run(Step.of(self.model, *words))

    def session(self, name: str, seed: int) -> dict[str, Any]:
        """report.json of a session with the payload; `seed`: of its motions and noise."""
        self._measured(name, seed, AFTER)
        loop = self.circle.out / f"{name}.loop"
        closed = ("close-loop", self.circle.out / f"{name}.ds", "--model", self.model, "--out", loop)
        self.circle.steps.run(Step.of(loop / "report.json", *closed))
        return report_of(loop)

    def _measured(self, name: str, seed: int, words: tuple[object, ...]) -> None:
        """A campaign and its dataset."""
        folder = self.circle.out / name
        seeds = ("--settings", self.circle.out / "lab.toml", "--seed", seed, "--robot-seed", self.seed, "--jobs", 1)
        self.circle.steps.run(Step.of(folder / "report.html", "lab", "campaign", "--out", folder, *words, *seeds))
        self.circle.steps.run(self.circle.dataset(f"{name}.ds", folder / "power.sqlite", folder / "logs"))


def torque_scale(seed: int) -> float:
    """Scale of the torque sensors of the robot of a seed, drawn as the loop assumes it to be distributed."""
    random = np.random.default_rng([seed, len(TRUTH)])
    return 1.0 + THRESHOLDS.sensor_scale_deviation * float(random.standard_normal())


def session(out: Path, seed: int, one_robot: bool, console: Console) -> Judged:
    """Measure, merge and close the loop for one seed: on the page's robot, or on a robot of that seed."""
    if one_robot:
        robot = Robot.of(out / "one-robot", _PAGE, 1.0, console)
        name, motions = f"seed-{seed:03d}", seed
    else:
        robot = Robot.of(out / f"robot-{seed:03d}", seed, torque_scale(seed), console)
        name, motions = "after", seed + _MOTION_SEED
    robot.reference()
    return judged(seed, robot.session(name, motions))


def tables(results: list[Judged]) -> list[Table]:
    """Every session, and how many intervals hold."""
    all_ = Table("seed", "named (simulated)", *TRUTH, title=f"truth: {TRUTH}")
    for each in results:
        cells = [
            f"{each.sizes[name][0]:.4g} ({each.sizes[name][1][0]:.4g} to {each.sizes[name][1][1]:.4g})"
            + ("" if each.holds(name) else " no")
            if name in each.sizes
            else "-"
            for name in TRUTH
        ]
        all_.add_row(str(each.seed), each.named, *cells)
    heads = ("hold the truth", "95 % interval of the share", "RMS error", "half width of the intervals")
    sums = Table("parameter", "intervals", *heads)
    for name, truth in TRUTH.items():
        known = [each for each in results if name in each.sizes]
        if known:
            held = sum(bool(each.holds(name)) for each in known)
            share = binomtest(held, len(known)).proportion_ci(method="wilson")
            sizes = [each.sizes[name] for each in known]
            error = float(np.sqrt(np.mean([(value - truth) ** 2 for value, _ in sizes])))
            half = float(np.mean([(high - low) / 2 for _, (low, high) in sizes]))
            words = (f"{percent(share.low)} to {percent(share.high)}", f"{error:.2g}", f"{half:.2g}")
            sums.add_row(name, str(len(known)), str(held), *words)
    return [all_, sums]


def main() -> None:
    """Run what is missing, print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=_FIRST_SEED)
    parser.add_argument("--one-robot", action="store_true", help="all sessions on the page's robot")
    arguments = parser.parse_args()
    console = Console(stderr=True)
    results = []
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
        results.append(session(arguments.out, seed, arguments.one_robot, console))
        for table in tables(results):
            Console(width=140).print(table)


if __name__ == "__main__":
    main()
