"""Errors of the lags that `acqd dataset build` finds, in simulated campaigns whose clocks and supplies are known.

    python -m tools.studies.alignment OUT [--seeds tune|test] [--campaigns 2] [--json FILE]

OUT keeps the played campaigns. The logs have no torques; those of the robots with six axes have no brake signal
either. Every third case has a clock that is set by 60 ms.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import orjson
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.report.digits import percent
from tools.studies.alignment.bed import campaign
from tools.studies.alignment.cases import SUPPLIES, Result, run_case

_ROBOTS = ("iiwa7_r800", "ur10e", "ur3e")
_SEEDS = {"tune": 1, "test": 101}
_RECORDINGS = (12, 8)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", choices=sorted(_SEEDS), default="test", help="tune: those the method was tuned on")
    parser.add_argument("--campaigns", type=int, default=2, help="per robot")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    results: list[Result] = []
    work = [(robot, number) for robot in _ROBOTS for number in range(arguments.campaigns)]
    for robot, number in track(work, "campaigns", console=Console(stderr=True)):
        seed = _SEEDS[arguments.seeds] + number
        folder = arguments.out / f"{robot}-{seed}"
        played = campaign(folder, robot, seed, _RECORDINGS[number % 2])
        results += [run_case(played, supply, seed, k, folder) for k, supply in enumerate(SUPPLIES, number)]
    figures = [_figures(name, chosen) for name, chosen in _groups(results)]
    table = Table(*figures[0], title=f"lags without torque, seeds for {arguments.seeds} (simulated)")
    for row in figures:
        table.add_row(*(str(value) for value in row.values()))
    Console(width=170).print(table)
    if arguments.json:
        arguments.json.write_bytes(orjson.dumps(figures, option=orjson.OPT_INDENT_2))


def _groups(results: list[Result]) -> list[tuple[str, list[Result]]]:
    by_supply = [
        (f"{1000 * s.lag_s:.0f} ms" if not s.delay_s else f"delay {1000 * s.delay_s:.0f} ms", s) for s in SUPPLIES
    ]
    groups = [(name, [each for each in results if each.supply == supply]) for name, supply in by_supply]
    groups += [(f"{axes} axes", [each for each in results if each.axes == axes]) for axes in (6, 7)]
    return [*groups, ("all", results)]


def _figures(name: str, results: list[Result]) -> dict[str, object]:
    errors = 1000 * np.concatenate([each.errors_s for each in results])
    within = 1000 * np.concatenate([each.within_s for each in results])
    announced = np.concatenate([np.full(len(each.errors_s), each.announced) for each in results])
    placed = np.isfinite(errors)
    size = np.abs(errors[placed])
    return {
        "supply": name,
        "logs": len(errors),
        "refused": int((~placed).sum()),
        "median [ms]": round(float(np.median(errors[placed])), 1),
        "95 % [ms]": round(float(np.percentile(size, 95)), 1),
        "worst [ms]": round(float(size.max()), 1),
        "within 10 ms": percent((size <= 10).mean()),
        "in interval": percent((size <= within[placed]).mean()),
        "> 20 ms, silent": int((size[~announced[placed]] > 20).sum()),
        "clock set, found": f"{sum(each.steps_found > 0 for each in results if each.was_set)} of "
        f"{sum(each.was_set for each in results)}",
        "false steps": sum(each.steps_found > 0 for each in results if not each.was_set),
        "supply found [ms]": round(1000 * float(np.median([each.supply_s for each in results])), 1),
    }


if __name__ == "__main__":
    main()
