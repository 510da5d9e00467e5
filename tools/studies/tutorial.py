"""How often the intervals of the first ten minutes hold the truth: the page's payload in sessions of other seeds.

    python -m tools.studies.tutorial OUT [--seeds 20] [--first-seed 2]

One robot in good order is measured and modelled once. For every seed a session with 1.5 kg at its flange follows, as on
docs/first-ten-minutes.md, and the loop closes on it. All data are simulated. What is there already is not made again. A
95 % interval of mass or centre of mass should hold the truth in 95 % of the sessions.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from acqd.cli.lab.circle import Circle, report_of
from acqd.cli.lab.steps import Step, Steps
from acqd.lab.plant.mechanics import PAYLOAD_CENTRE_M
from acqd.report.digits import percent

MASS_KG = 1.5
TRUTH = {"mass": MASS_KG, "centre_of_mass_m": PAYLOAD_CENTRE_M}
BEFORE = ("--limited", 4, "--all", 8, "--seed", 1)
AFTER = ("--limited", 4, "--all", 4, "--robot-seed", 1, "--undeclared", f"payload:mass_kg={MASS_KG}")
_FIRST_SEED = 2


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
    """The sizes of a report.json that names a payload first."""
    named = ", ".join(f"{each['id']} ({each['where']})" for each in report["effects"]) or report["verdict"]
    first = report["effects"][0] if report["effects"] else None
    if first is None or first["id"] != "payload":
        return Judged(seed, named, {})
    parameters = first["parameters"]
    sizes = {
        name: (parameters[name]["value"], parameters[name]["ci95"])
        for name in TRUTH
        if name in parameters and parameters[name]["ci95"]
    }
    return Judged(seed, named, sizes)


def session(out: Path, seed: int, console: Console) -> Judged:
    """Measure, merge and close the loop for one seed; the model is that of `out`."""
    circle = Circle(Steps(out / f"seed-{seed:03d}", console), "iiwa7_r800")
    circle.out.mkdir(parents=True, exist_ok=True)
    after = circle.out / "after"
    measured = ("lab", "campaign", "--out", after, *AFTER, "--seed", seed, "--jobs", 1)
    circle.steps.run(Step.of(after / "report.html", *measured))
    circle.steps.run(circle.dataset("after.ds", after / "power.sqlite", after / "logs"))
    closed = ("close-loop", circle.out / "after.ds", "--model", out / "model", "--out", circle.loop)
    circle.steps.run(Step.of(circle.loop / "report.json", *closed))
    return judged(seed, report_of(circle.loop))


def reference(out: Path, console: Console) -> None:
    """The robot in good order, and its model."""
    circle = Circle(Steps(out, console), "iiwa7_r800")
    out.mkdir(parents=True, exist_ok=True)
    before = out / "before"
    circle.steps.run(Step.of(before / "report.html", "lab", "campaign", "--out", before, *BEFORE, "--jobs", 1))
    circle.steps.run(circle.dataset("before.ds", before / "power.sqlite", before / "logs"))
    words = ("train", out / "before.ds", "--network", "grey-box", "--out", out / "model")
    circle.steps.run(Step.of(out / "model", *words))


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
    sums = Table("parameter", "intervals", "hold the truth", "95 % interval of the share")
    for name in TRUTH:
        known = [held for each in results if (held := each.holds(name)) is not None]
        if known:
            share = binomtest(sum(known), len(known)).proportion_ci(method="wilson")
            sums.add_row(name, str(len(known)), str(sum(known)), f"{percent(share.low)} to {percent(share.high)}")
    return [all_, sums]


def main() -> None:
    """Run what is missing, print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=_FIRST_SEED)
    arguments = parser.parse_args()
    console = Console(stderr=True)
    reference(arguments.out, console)
    results = []
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
        results.append(session(arguments.out, seed, console))
        for table in tables(results):
            Console(width=140).print(table)


if __name__ == "__main__":
    main()
