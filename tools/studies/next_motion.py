"""Judges `acqd next` in the laboratory: does the designed recording bring the right name, and does random motion?

    python -m tools.studies.next_motion OUT [--robot ur10e] [--seed 77123] [--cause payload:mass_kg=0.35 ...] [--json]

One virtual robot. For every cause: a short campaign in limited space with the cause hidden in it, the loop, the program
that `acqd next` designs, its execution on the same robot with the same cause, and the loop with both sessions. Beside
it stands random motion of the thesis' kind (all space) of at least the same length. The laboratory's plant is not the
model of the loop, and its parameters are drawn. Steps that are there are not made again.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.report.digits import percent
from tools.common.commands import acqd_json
from tools.common.tables import show, verdict

CAUSES = (
    "payload:mass_kg=0.35", "gravity_bias:mass_kg=0.5,axis=6", "coulomb_friction:relative=0.08,axis=2",
    "viscous_friction:relative=0.1,axis=3", "copper_loss:relative=0.15", "supply_efficiency:loss_at_100W=2",
)  # fmt: skip
"""Small, so that a short campaign leaves some of them open."""
_BEFORE = ("--limited", "4", "--all", "8")
_SHORT = ("--limited", "4", "--all", "0")
_RANDOM = ("--limited", "0", "--all", "5")
"""Five recordings of half a minute to a minute."""


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--robot", default="ur10e")
    parser.add_argument("--seed", type=int, default=77123)
    parser.add_argument("--cause", action="append", help=f"default {' '.join(CAUSES)}")
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


class Circle:
    """The steps for one virtual robot."""

    def __init__(self, out: Path, robot: str, seed: int) -> None:
        self.out, self.robot, self.seed = out, robot, seed
        out.mkdir(parents=True, exist_ok=True)
        self.before = self.dataset("before", self.campaign("before", _BEFORE))
        self.model = self.before.with_name("before.ds.models") / "grey-box-everything-s1"
        if not self.model.exists():
            acqd_json("train", self.before, "--network", "grey-box")

    def campaign(self, name: str, amount: tuple[str, ...], *effect: str) -> tuple[Path, Path]:
        """Power and logs of a campaign."""
        folder = self.out / name
        if not (folder / "report.html").exists():
            robot = ("--robot", self.robot, "--seed", str(self.seed), "--jobs", "1")
            acqd_json("lab", "campaign", "--out", folder, *amount, *robot, *effect)
        return folder / "power.sqlite", folder / "logs"

    def dataset(self, name: str, recorded: tuple[Path, Path], *more: str) -> Path:
        """Of power and logs."""
        folder = self.out / f"{name}.ds"
        if not folder.exists():
            power, logs = recorded
            acqd_json(
                "dataset", "build", "--power", power, "--logs", logs, "--robot", self.robot, "--out", folder, *more
            )
        return folder

    def closed(self, dataset: Path, *further: Path) -> dict[str, Any]:
        """The report of the loop on one session, or on two."""
        folder = dataset.with_name(f"{dataset.name}.loop{'-'.join(['', *(each.stem for each in further)])}")
        if not (folder / "report.json").exists():
            more = [word for each in further for word in ("--with", each)]
            acqd_json("close-loop", dataset, "--model", self.model, "--out", folder, *more)
        report: dict[str, Any] = json.loads((folder / "report.json").read_bytes())
        return report | {"folder": str(folder)}

    def run(self, cause: str) -> dict[str, Any]:
        """What the loop says before, after the designed recording, and after random motion."""
        name = cause.replace(":", "-").replace(",", "-").replace("=", "")
        short = self.dataset(name, self.campaign(name, _SHORT, "--undeclared", cause))
        now = self.closed(short)
        design = self.out / f"{name}.next"
        if not design.exists():
            acqd_json("next", now["folder"], "--limit-speed", "100", "--out", design)
        promised = json.loads((design / "next.json").read_bytes())
        work_min = promised.get("worked_min")
        worked = ("--worked", str(work_min)) if work_min else ()
        executed = self.out / f"{name}.executed"
        if not executed.exists():
            robot = ("--robot", self.robot, "--seed", str(self.seed), "--effect", cause, *worked)
            acqd_json("lab", "execute", design / "motion.csv", *robot, "--out", executed)
        files = executed / "rows.jsonl", executed / "motion.csv"
        second = self.dataset(f"{name}.second", files, "--cut", str(promised["cut_s"]), *worked)
        other = self.campaign(f"{name}.random", _RANDOM, "--undeclared", cause)
        reports = {
            "now": now, "designed": self.closed(short, second),
            "random": self.closed(short, self.dataset(f"{name}.other", other)),
        }  # fmt: skip
        right = cause.partition(":")[0]
        return {
            "cause": cause, "promised": promised["right_name"], "compared": [each["id"] for each in promised["causes"]],
            "said": {each: _said(report) for each, report in reports.items()},
            "right": {each: _is_right(report, right) for each, report in reports.items()},
        }  # fmt: skip


def _said(report: dict[str, Any]) -> str:
    """Names with their confidence, or the verdict."""
    names = ", ".join(f"{each['id']} {percent(each['confidence'])}" for each in report["effects"])
    return names or str(report["verdict"])


def _is_right(report: dict[str, Any], cause: str) -> bool:
    """Whether the loop names the cause, alone and without doubt between several names."""
    first = report["effects"][0] if report["effects"] else None
    return first is not None and first["id"] == cause and not first["family"]["members"]


def main() -> None:
    """Print a line per cause."""
    given = options()
    circle = Circle(given.out, given.robot, given.seed)
    results = [circle.run(cause) for cause in track(given.cause or CAUSES, "causes", console=Console(stderr=True))]
    if given.json:
        print(json.dumps(results))
        return
    table = Table("cause (simulated)", "now", "after the design", "after random motion", "promised", "right")
    for each in results:
        promised = " / ".join(percent(each["promised"][key]) for key in ("now", "designed", "random"))
        right = " / ".join(verdict(each["right"][key], "yes", "no") for key in ("now", "designed", "random"))
        table.add_row(each["cause"], *each["said"].values(), promised, right)
    show(table, width=170)
    for key in ("now", "designed", "random"):
        print(f"{key}: {sum(each['right'][key] for each in results)} of {len(results)} named rightly, without a doubt")


if __name__ == "__main__":
    main()
