"""Judges the certificate that ends every closing report (`acqd robot ability`) by cases of the foreign study.

    python -m tools.studies.foreign.certificate OUT [OUT ...] [--label base] [--json]

OUT are folders of `python -m tools.studies.foreign OUT`. Every case with one hidden effect of the library has a true
size, and its report states the smallest size that such recordings show at the true place. Effects of at least twice
that size should have their name in 90 % of the cases, effects of less than half of it in at most 30 %. A pair of
effects is separable at the true size if the report says so; the pair is separated if the true effect is named, and the
other one is neither named nor a member of the family. Nothing is run.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from rich.table import Table

from tools.common.tables import show
from tools.studies.foreign.judge import Result, accepts, kind, named
from tools.studies.foreign.runner import result_files

_BANDS = (0.0, 0.5, 1.0, 2.0, 4.0, float("inf"))
"""Times the smallest size."""


@dataclass(frozen=True, slots=True)
class Stated:
    """A case beside what its report states about the true effect."""

    world: str
    case: str
    where: str
    times: float
    """True size divided by the smallest size."""
    limited_by: str
    named: bool
    """Whether the report names the effect."""
    separable: dict[str, bool]
    """Effects that the report calls separable from the true one at the true size, and whether they are separated."""
    close: tuple[str, ...]
    """Those among them that are not separable at every size that shows."""

    @property
    def family(self) -> str:
        """Plants of a kind: the world without its seed."""
        return self.world.rpartition("-seed")[0]


def stated(result: Result) -> Stated | None:
    """None for cases without one effect of the library, and where the report states no size for the true place."""
    report = result["report"]
    if not report or kind(result) != "single" or "ability" not in report:
        return None
    true = result["truth"][0]
    place = _place(report["ability"]["effects"], true)
    if place is None:
        return None
    size = abs(true["size"] if true["value"] is None else true["value"])
    found = [effect for effect in named(result) if accepts(true["id"], effect, result["axes"])]
    said = {effect["id"] for effect in named(result)}
    said |= {member["id"] for effect in named(result) for member in effect["family"]["members"]}
    judged = {each["id"] for each in report["ability"]["effects"]} - {true["id"]}
    confused = {each["id"]: each["told_apart_from"] for each in place["rivals"]}
    separable = {
        other: bool(found) and other not in said
        for other in judged
        if size >= place["smallest"] and (other not in confused or size >= (confused[other] or float("inf")))
    }
    return Stated(
        result["world"], result["case"], true["where"], size / place["smallest"], place["limited_by"], bool(found),
        separable, tuple(sorted(set(separable) & set(confused))),
    )  # fmt: skip


def _place(places: Sequence[dict[str, Any]], true: dict[str, Any]) -> dict[str, Any] | None:
    """The place of the true effect, in the shape that is closest to the true one; None without one in its unit."""
    own = [
        each for each in places
        if each["id"] == true["id"] and each["where"].partition(",")[0] == true["where"]
        and each["unit"] == true["unit"] and each["smallest"] is not None
    ]  # fmt: skip
    shape = true["details"]
    return min(
        own, key=lambda each: sum(abs(value - shape.get(name, value)) for name, value in each["shape"].items()),
        default=None,
    )  # fmt: skip


def figures(cases: Sequence[Stated]) -> dict[str, tuple[int, int]]:
    """Name of a figure -> number of cases that hold, and number of cases."""
    found = {}
    for low, high in pairwise(_BANDS):
        inside = [case.named for case in cases if low <= case.times < high]
        found[f"named at {low:g} to {high:g} times the smallest size"] = sum(inside), len(inside)
    beyond = [case.named for case in cases if case.times >= 2]
    below = [case.named for case in cases if case.times < 0.5]
    pairs = [apart for case in cases for apart in case.separable.values()]
    close = [case.separable[other] for case in cases for other in case.close]
    return found | {
        "named at twice the smallest size or more (90 %)": (sum(beyond), len(beyond)),
        "named below half of it (at most 30 %)": (sum(below), len(below)),
        "separable pairs that are separated (90 %)": (sum(pairs), len(pairs)),
        "pairs that only larger sizes separate (90 %)": (sum(close), len(close)),
    }


def _read(folders: Sequence[Path], label: str) -> Iterator[Stated]:
    for folder in folders:
        for file in result_files(folder, label):
            case = stated(json.loads(file.read_text()))
            if case is not None:
                yield case


def main() -> None:
    """Print the shares, of all plants and of every family of plants, and the cases that break the promise."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, nargs="+", metavar="OUT")
    parser.add_argument("--label", default="base", help="folder of the results (default base)")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    cases = list(_read(given.out, given.label))
    if not cases:
        sys.exit(f"{given.out[0]} has no results of label {given.label}: python -m tools.studies.foreign OUT")
    groups = {"all": cases}
    for family in sorted({case.family for case in cases}):
        groups[family] = [case for case in cases if case.family == family]
    if given.json:
        print(json.dumps({"figures": {name: figures(own) for name, own in groups.items()},
                          "cases": [asdict(case) for case in cases]}))  # fmt: skip
        return
    table = Table("certificate of closing reports (simulated)", *groups)
    columns = [figures(own) for own in groups.values()]
    for name in columns[0]:
        table.add_row(name, *(f"{good} of {count}" for good, count in (column[name] for column in columns)))
    show(table, width=150)
    for case in cases:
        confused = [other for other, apart in case.separable.items() if not apart] if case.named else []
        broken = not case.named if case.times >= 2 else case.named and case.times < 0.5
        if broken or confused:
            said = "named" if case.named else "not named"
            beside = f", beside {', '.join(confused)}" if confused else ""
            print(f"{case.world} {case.case} ({case.where}): {case.times:.1f} times, {said}{beside}")


if __name__ == "__main__":
    main()
