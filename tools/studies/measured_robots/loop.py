"""Closing the loop on measured robots: a term withheld from the model must be named and come back.

    python -m tools.studies.measured_robots.loop OUT [--data ../shared/data/robots]

Datasets as in tools.studies.measured_robots (UR3e: measured at its 48 V bus; UR10e and Kinova: derived from currents).
Then, for every robot, a grey box with nothing withheld, and one without copper loss, without mechanical power, and
without dry friction; `acqd close-loop` on each.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tools.studies.measured_robots.__main__ import ROBOTS, acqd, prepare

_CUT_S = 5.0
"""The loop's noise model remembers more than a second: shorter pieces tell it nothing."""
WITHHELD = ("", "copper_loss", "mechanical_power", "coulomb_friction", "viscous_friction")


def main() -> None:
    """One table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[4] / "shared" / "data" / "robots")
    parser.add_argument("--robots", nargs="*", default=[robot.name for robot in ROBOTS])
    arguments = parser.parse_args()
    table = Table("robot", "withheld", "verdict", "named", "held-out RMSE before -> after [W]")
    for robot in ROBOTS:
        if robot.name not in arguments.robots:
            continue
        out = arguments.out / robot.name
        ds = str(out / "ds")
        if not Path(ds).exists():
            prepare(robot, arguments.data, out)
            acqd(
                "dataset", "build", "--power", f"{out}/power.csv", "--logs", f"{out}/logs", "--robot", robot.name,
                "--lag", "0", "--cut", str(max(robot.cut_s, _CUT_S)), "--out", ds,
            )  # fmt: skip
        for term in WITHHELD:
            bundle = out / "models" / (f"without-{term}" if term else "all")
            denied = ("--without", term) if term else ()
            acqd("train", ds, "--network", "grey-box", "--out", str(bundle), *denied)
            command = [
                sys.executable,
                "-m",
                "acqd",
                "close-loop",
                ds,
                "--model",
                str(bundle),
                "--out",
                f"{out}/loop-{term or 'all'}",
                "--json",
            ]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                table.add_row(robot.name, term or "nothing", done.stderr.strip().splitlines()[-1], "", "")
                continue
            report = json.loads(done.stdout)
            named = "; ".join(f"{e['id']} ({e['where']}) {e['confidence']:.0%}" for e in report["effects"])
            errors = f"{report['before']['rmse']:.2f} -> {report['after']['rmse']:.2f}"
            table.add_row(robot.name, term or "nothing", report["verdict"], named or report["unexplained"], errors)
    Console(width=170).print(table)


if __name__ == "__main__":
    main()
