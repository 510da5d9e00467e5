"""Blind benchmark of `acqd close-loop` on the virtual laboratory (simulated data).

    python -m tools.studies.effects OUT [--robot iiwa7_r800] [--seed 101] [--base grey-box] [--cases NAME...]

Every effect of the laboratory at 1, 3 and 10 % of the dynamic range, no effect, pairs, three shapes outside of the
library. The tracer gets a dataset and a bundle, as a user would; the truth is read only to keep the score. What is
there already is not done again.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from acqd.report.digits import percent
from tools.studies.effects.cases import OUTSIDE_IDS, Case, World, make_case
from tools.studies.effects.prepared import known_for, prepared
from tools.studies.effects.score import table

STRENGTHS = (0.03, 0.10, 0.01)
PAIRS = (
    ("payload", "coulomb_friction"), ("thermostat", "copper_loss"), ("brake_release", "viscous_friction"),
    ("offset_shift", "gravity_bias"), ("line_voltage", "load_dependent_friction"), ("gear_ripple", "payload"),
    ("process_load", "stribeck_friction"), ("supply_efficiency", "coulomb_friction"),
)  # fmt: skip
CLEAN = 8


def cases(known: list[str]) -> list[Case]:
    """All of them, the telling ones first."""
    found = [Case(f"clean{test}", test, ()) for test in range(1, CLEAN + 1)]
    for strength in STRENGTHS:
        found += [Case(f"{effect}-{strength:g}", 1, ((effect, strength),)) for effect in known]
    for strength in (0.03, 0.10):
        found += [Case(f"{effect}-{strength:g}", 1, ((effect, strength),)) for effect in OUTSIDE_IDS]
    found += [Case(f"{one}+{other}", 2, ((one, 0.1), (other, 0.1))) for one, other in PAIRS]
    return found


def run_case(world: World, bundle: Path, base: str, case: Case) -> dict[str, Any]:
    """Make the dataset, close the loop on it, keep what both say."""
    os.environ["OMP_NUM_THREADS"] = "1"
    from acqd.discrepancy.config import CloseConfig
    from acqd.discrepancy.loop import close_loop
    from acqd.discrepancy.report.summary import as_json
    from acqd.discrepancy.report.write import write_all

    result_file = world.folder / "results" / base / f"{case.name}.json"
    if result_file.exists():
        return dict(json.loads(result_file.read_text()))
    truth = make_case(world, case)
    begun = time.monotonic()
    order = CloseConfig(Path(truth["dataset"]), bundle, world.folder / "loops" / base / case.name)
    closed = close_loop(order, lambda *_: None)
    report = as_json(order, closed)
    seconds = time.monotonic() - begun
    write_all(order, closed)
    result = {"case": case.name, "truth": truth["effects"], "report": report, "seconds": seconds}
    result_file.parent.mkdir(parents=True, exist_ok=True)
    result_file.write_text(json.dumps(result))
    return result


def main() -> None:
    """Run what is missing, print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--robot", default="iiwa7_r800")
    parser.add_argument("--seed", type=int, default=101)
    parser.add_argument("--base", default="grey-box")
    parser.add_argument("--epochs", type=int, default=1000, help="of a network as base")
    parser.add_argument("--cases", nargs="*", help="names or beginnings of names")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--tables-only", action="store_true")
    arguments = parser.parse_args()
    out = arguments.out.resolve()
    world = World.of(arguments.robot, arguments.seed, out, CLEAN)
    wanted = cases(known_for(world))
    if arguments.cases:
        wanted = [case for case in wanted if any(case.name.startswith(name) for name in arguments.cases)]
    console = Console(width=150)
    if not arguments.tables_only:
        bundle = prepared(world, arguments.base, arguments.epochs)
        with ProcessPoolExecutor(arguments.jobs) as pool:
            work = {pool.submit(partial(run_case, world, bundle, arguments.base), case): case for case in wanted}
            for number, done in enumerate(as_completed(work), start=1):
                name = work[done].name
                error = done.exception()
                if error is not None:
                    console.print(f"{number}/{len(work)} {name}: {type(error).__name__}: {error}", highlight=False)
                    continue
                report = done.result()["report"]
                found = ", ".join(f"{e['id']} {percent(e['confidence'])}" for e in report["effects"])
                console.print(f"{number}/{len(work)} {name}: {report['verdict']} {found}", highlight=False)
    results = [json.loads(path.read_text()) for path in sorted((out / "results" / arguments.base).glob("*.json"))]
    for each in table(results):
        console.print(each)


if __name__ == "__main__":
    main()
