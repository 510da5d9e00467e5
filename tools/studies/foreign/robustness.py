"""Moves the quantities of the loop by 30 % and counts the verdicts that change, on cases of the foreign study.

    python -m tools.studies.foreign.robustness OUT [--label base] [--only GLOB] [--json]

The cases are those with results in OUT (`python -m tools.studies.foreign OUT`). A verdict is its kind and the names of
the effects. `p` moves the probability of a wrong name that a finding may have, not that of a right one.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import UserError
from tools.common.tables import show
from tools.studies.foreign.cases import World
from tools.studies.foreign.runner import Runner, result_files

QUANTITIES = {
    "kappa": "column_error", "tau": "usual_difference", "pi": "chance", "delta": "least_share_of_range",
    "p": "least_confidence",
}  # fmt: skip
FACTORS = (0.7, 1.3)
_WIDTH = 100


@contextmanager
def moved(name: str, factor: float) -> Iterator[None]:
    """With another value of a threshold."""
    value = getattr(THRESHOLDS, name)
    other = 1 - (1 - value) * factor if name == "least_confidence" else value * factor
    object.__setattr__(THRESHOLDS, name, other)  # the values in use are frozen for everybody else
    try:
        yield
    finally:
        object.__setattr__(THRESHOLDS, name, value)


def verdict(dataset: Path, bundle: Path) -> list[str]:
    """Kind of the verdict, and the names."""
    try:
        closed = close_loop(CloseConfig(dataset, bundle, dataset.with_name("unused")), lambda *_: None)
    except UserError as error:
        return ["refused", str(error)]
    return [closed.verdict, *sorted(each.term.id for each in closed.named)]


def judged(out: Path, path: Path) -> dict[str, Any]:
    """Verdict of a case as it is, and where it changes."""
    result = json.loads(path.read_text())
    world = world_of(result["world"])
    runner = Runner(out, world, path.parents[1].name, None)
    dataset = runner.work / "robustness" / path.stem / "ds"
    runner.build(runner.data / path.stem, dataset)
    bundle = runner.work / "model"
    usual = verdict(dataset, bundle)
    changes = {}
    for sign, name in QUANTITIES.items():
        for factor in FACTORS:
            with moved(name, factor):
                other = verdict(dataset, bundle)
            if other != usual:
                changes[f"{sign} x {factor:g}"] = other
    shutil.rmtree(dataset.parent)
    return {"world": world.name, "case": path.stem, "verdict": usual, "changes": changes}


def world_of(name: str) -> World:
    """The plant whose files lie in a folder of that name."""
    parts = name.split("-")
    extras = parts[2:-1]
    return World(
        int(parts[0].removeprefix("axes")), int(parts[-1].removeprefix("seed")), parts[1], "torque" in extras,
        "clocks" in extras, "harsh" in extras,
    )  # fmt: skip


def main() -> None:
    """Print how many verdicts change."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--label", default="base")
    parser.add_argument("--only", action="append", metavar="GLOB")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    paths = [
        path for path in result_files(given.out.resolve(), given.label)
        if not given.only or any(fnmatch(path.stem, glob) for glob in given.only)
    ]  # fmt: skip
    if not paths:
        sys.exit(f"{given.out} has no results of label {given.label}; make some: python -m tools.studies.foreign OUT")
    rows = []
    for number, path in enumerate(paths, start=1):
        rows.append(judged(given.out.resolve(), path))
        Console(stderr=True).print(f"{number} of {len(paths)}: {rows[-1]}", highlight=False)
    if given.json:
        print(json.dumps(rows))
        return
    table = Table("quantity", "factor", "verdicts that change", "share")
    for sign in QUANTITIES:
        for factor in FACTORS:
            count = sum(f"{sign} x {factor:g}" in each["changes"] for each in rows)
            table.add_row(sign, f"{factor:g}", f"{count} of {len(rows)}", f"{100 * count / len(rows):.0f} %")
    show(table, width=_WIDTH)


if __name__ == "__main__":
    main()
