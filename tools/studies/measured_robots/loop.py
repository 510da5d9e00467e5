"""Closing the loop on measured robots: a term withheld from the model must be identified and restored.

    python -m tools.studies.measured_robots.loop OUT [--data ../shared/data/robots]

The datasets are made by tools.studies.measured_robots. For every robot a complete grey box is trained, and one each
without copper loss, mechanical power, Coulomb friction and viscous friction; then `acqd close-loop` runs on each.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from acqd.report.digits import percent
from tools.studies.measured_robots.__main__ import ROBOTS, acqd, prepare

_CUT_S = 5.0
"""s; the autoregressive noise model of the loop spans more than a second and needs longer pieces."""
WITHHELD = ("", "copper_loss", "mechanical_power", "coulomb_friction", "viscous_friction")


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[4] / "shared" / "data" / "robots")
    parser.add_argument("--robots", nargs="*", default=[robot.name for robot in ROBOTS])
    arguments = parser.parse_args()
    table = Table("robot", "withheld", "verdict", "identified", "held-out RMSE before -> after [W]")
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
            without = ("--without", term) if term else ()
            acqd("train", ds, "--network", "grey-box", "--out", str(bundle), *without)
            options = ("--model", str(bundle), "--out", f"{out}/loop-{term or 'all'}", "--json")
            command = [sys.executable, "-m", "acqd", "close-loop", ds, *options]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                table.add_row(robot.name, term or "nothing", done.stderr.strip().splitlines()[-1], "", "")
                continue
            report = json.loads(done.stdout)
            identified = "; ".join(f"{e['id']} ({e['where']}) {percent(e['confidence'])}" for e in report["effects"])
            errors = f"{report['before']['rmse']:.2f} -> {report['after']['rmse']:.2f}"
            table.add_row(robot.name, term or "nothing", report["verdict"], identified or report["unexplained"], errors)
    Console(width=170).print(table)


if __name__ == "__main__":
    main()
