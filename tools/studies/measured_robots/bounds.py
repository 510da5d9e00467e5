"""Findings that physics forbids, or whose every interval holds zero, in reports of `acqd close-loop`.

    python -m tools.studies.measured_robots.bounds FOLDER...

Every report.json below the folders is read, with the dataset and the model that it names; the bounds of a parameter are
those of its effect at its place. The other studies of this folder leave such reports. Exit code 1 with a fault.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from acqd.discrepancy.recordings import carrier_in
from acqd.models.bundle.restore import open_model
from acqd.models.effects import library
from acqd.models.effects.scene import Scene, segment_scene
from acqd.models.segments import load_dataset
from tools.common.tables import show


@dataclass(frozen=True, slots=True)
class Fault:
    """A finding that physics forbids, or that may be nothing."""

    effect: str
    text: str


def scene_of(report: dict[str, Any]) -> Scene:
    """The first recording of the report's dataset, with the grey box of its model."""
    path = Path(report["model"]["bundle"])
    carrier = carrier_in(*open_model(path))
    assert carrier is not None, f"{path}: has no grey box"
    return segment_scene(carrier, load_dataset(Path(report["dataset"])).segments[0])


def faults(report: dict[str, Any], scene: Scene) -> Iterator[Fault]:
    """What is wrong with the effects of a report."""
    for effect in report["effects"]:
        intervals = [each["ci95"] for each in effect["parameters"].values() if each["ci95"] is not None]
        if intervals and all(low <= 0 <= high for low, high in intervals):
            yield Fault(effect["id"], "every interval holds zero")
        for name, (low, high) in bounds(effect, scene).items():
            value = effect["parameters"][name]["value"]
            if not low <= value <= high:
                yield Fault(effect["id"], f"{name} is {value:.4g}, possible are {low:.4g} to {high:.4g}")


def bounds(effect: dict[str, Any], scene: Scene) -> dict[str, tuple[float, float]]:
    """Physical bounds of the reported parameters that have some."""
    known = library()[effect["id"]]
    if known.detected or not known.possible(scene):
        return {}
    places = list(known.places(scene))
    here = [place for place in places if place.where == effect["where"]] or places
    found: dict[str, tuple[float, float]] = {}
    for each in (parameter for place in here for parameter in place.parameters):
        low, high = found.get(each.name, (np.inf, -np.inf))
        found[each.name] = (min(low, each.low), max(high, each.high))
    return {name: limits for name, limits in found.items() if name in effect["parameters"]}


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    given = parser.parse_args()
    table, wrong = Table("report", "verdict", "findings", "bounds", "faults"), 0
    for path in sorted({each for folder in given.folders for each in folder.rglob("report.json")}):
        report = json.loads(path.read_text())
        if "effects" not in report:
            continue  # of another command
        scene = scene_of(report) if report["effects"] else None
        found = list(faults(report, scene)) if scene else []
        checked = sum(len(bounds(effect, scene)) for effect in report["effects"]) if scene else 0
        wrong += len(found)
        names = ", ".join(effect["id"] for effect in report["effects"])
        texts = "; ".join(f"{each.effect}: {each.text}" for each in found)
        table.add_row(str(path.parent), report["verdict"], names or "-", str(checked), texts or "-")
    show(table, width=150)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
