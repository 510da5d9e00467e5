"""Moves the quantities of the loop by 30 % and counts the verdicts that change, on cases of the foreign study.

    python -m tools.studies.foreign.robustness OUT [--label base] [--only GLOB] [--show] [--json]

The cases are those with results in OUT (`python -m tools.studies.foreign OUT`). What a case has shown is kept beside
the results, and not made again. A verdict is its kind and the names of the effects. `p` moves the probability of a
wrong name that a finding may have, not that of a right one.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
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
from tools.studies.foreign.once import once
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


def robustness_file(path: Path) -> Path:
    """What a case with a result at `path` has shown."""
    return path.parents[1] / "robustness" / path.name


def judged(out: Path, path: Path) -> dict[str, Any]:
    """Verdict of a case as it is, and where it changes; a case that was judged is not judged again."""
    known = robustness_file(path)
    if known.exists():
        return dict(json.loads(known.read_text()))
    world = world_of(json.loads(path.read_text())["world"])
    runner = Runner(out, world, path.parents[1].name, None)
    dataset = known.with_suffix("") / "ds"
    shutil.rmtree(dataset, ignore_errors=True)  # of a run that was stopped
    runner.build(runner.data / path.stem, dataset)
    with once():
        usual, changes = _changes(dataset, runner.work / "model")
    shutil.rmtree(dataset.parent)
    case = {"world": world.name, "case": path.stem, "verdict": usual, "changes": changes}
    partial = known.with_suffix(f".{os.getpid()}.partial")
    partial.write_text(json.dumps(case))
    partial.rename(known)
    return case


def _changes(dataset: Path, bundle: Path) -> tuple[list[str], dict[str, list[str]]]:
    """The verdict, and other ones by the quantity that was moved."""
    usual, changes = verdict(dataset, bundle), {}
    for sign, name in QUANTITIES.items():
        for factor in FACTORS:
            with moved(name, factor):
                other = verdict(dataset, bundle)
            if other != usual:
                changes[f"{sign} x {factor:g}"] = other
    return usual, changes


def table_of(cases: list[dict[str, Any]]) -> Table:
    """How many verdicts change, by the quantity that was moved, and by any of them."""
    table = Table("quantity", "factor", "verdicts that change", "share")

    def row(sign: str, factor: str, changed: Sequence[object]) -> None:
        count = sum(map(bool, changed))
        table.add_row(sign, factor, f"{count} of {len(cases)}", f"{100 * count / max(len(cases), 1):.1f} %")

    for sign in QUANTITIES:
        for factor in FACTORS:
            row(sign, f"{factor:g}", [f"{sign} x {factor:g}" in each["changes"] for each in cases])
    row("any", "both", [each["changes"] for each in cases])
    return table


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
    parser.add_argument("--show", action="store_true", help="judge nothing: what the cases have shown so far")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    out = given.out.resolve()
    paths = [
        path for path in result_files(out, given.label)
        if not given.only or any(fnmatch(path.stem, glob) for glob in given.only)
    ]  # fmt: skip
    if given.show:
        paths = [path for path in paths if robustness_file(path).exists()]
    if not paths:
        sys.exit(f"{given.out} has no results of label {given.label}; make some: python -m tools.studies.foreign OUT")
    cases = []
    for number, path in enumerate(paths, start=1):
        cases.append(judged(out, path))
        if not given.show:
            Console(stderr=True).print(f"{number} of {len(paths)}: {cases[-1]}", highlight=False)
    if given.json:
        print(json.dumps(cases))
    else:
        show(table_of(cases), width=_WIDTH)


if __name__ == "__main__":
    main()
