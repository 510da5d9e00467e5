"""The sidecar under load with a real broker: killed while logs arrive, timed on logs of 400 s, and with live rows.

    python -m tools.studies.sidecar OUT --campaign CAMPAIGN --model BUNDLE [--kills 100] [--json FILE]

CAMPAIGN is a folder of `acqd lab campaign` (simulated data), BUNDLE a model of its robot. Prints whether every log was
processed exactly once, the seconds from a whole file to the published prediction, and the live round trip.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from acqd.cli.main import for_people
from acqd.errors import UserError
from tools.common.servers import mosquitto
from tools.studies.sidecar.cell import Cell
from tools.studies.sidecar.kills import killed
from tools.studies.sidecar.timing import live, long_log, runtime, timed

__all__ = ["Cell", "live", "long_log", "timed"]  # for tools.bench


def main() -> None:
    """Runs all trials and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--campaign", type=Path, required=True)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--logs", type=int, default=200, help="logs that arrive meanwhile")
    parser.add_argument("--live-rows", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    if options.out.exists():
        raise UserError(f"{options.out} exists; name another folder")
    (options.out / "logs").mkdir(parents=True)
    (options.out / "long" / "logs").mkdir(parents=True)
    results: dict[str, Any] = {}
    with mosquitto() as port:
        log, database = long_log(options.campaign, options.out / "long")
        cell = Cell(options.out / "long" / "logs", database, options.model, port)
        results["log of 400 s"] = timed(cell, log, 10)
        results["runtime"] = runtime(options.model, log)
        results["live"] = live(cell, log, options.live_rows)
        shutil.copy(options.campaign / "power.sqlite", options.out / "power.sqlite")
        sources = sorted((options.campaign / "logs").rglob("*.log"))[: options.logs]
        cell = Cell(options.out / "logs", options.out / "power.sqlite", options.model, port)
        results["killed"] = killed(cell, sources, options.kills, options.seed)
    table = Table("trial", "quantity", "measured")
    for trial, figures in results.items():
        for name, value in figures.items():
            table.add_row(trial, name, json.dumps(value) if isinstance(value, dict) else f"{value}")
    Console(width=120).print(table)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    for_people(main)
