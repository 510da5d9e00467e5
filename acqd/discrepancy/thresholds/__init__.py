"""The thresholds that decide a verdict: value, unit, meaning and where the value comes from.

Grids of searches (starting values, dwell times) and numerical floors stay with their methods.

Sources: "convention" is common statistical practice; "choice" is a definition that could have been made otherwise;
"study" was set by hand on simulated plants while the methods were developed, with seeds that nobody recorded, and
`python -m tools.studies.effects` judges the result on other campaigns; "physics" follows from what robots do.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Any

from acqd.discrepancy.thresholds.delay import DelayThresholds
from acqd.discrepancy.thresholds.detectors import DetectorThresholds
from acqd.discrepancy.thresholds.joints import JointThresholds
from acqd.discrepancy.thresholds.monitor import MonitorThresholds
from acqd.discrepancy.thresholds.noise import NoiseThresholds
from acqd.discrepancy.thresholds.recordings import RecordingThresholds
from acqd.discrepancy.thresholds.selection import SelectionThresholds
from acqd.discrepancy.thresholds.threshold import Stage
from acqd.discrepancy.thresholds.uncertainty import UncertaintyThresholds
from acqd.discrepancy.thresholds.verdict import VerdictThresholds

__all__ = ["THRESHOLDS", "Stage", "Thresholds", "described", "table"]


@dataclass(frozen=True)
class Thresholds(
    MonitorThresholds,
    JointThresholds,
    VerdictThresholds,
    UncertaintyThresholds,
    SelectionThresholds,
    DetectorThresholds,
    NoiseThresholds,
    DelayThresholds,
    RecordingThresholds,
):
    """The thresholds of the loop and of the monitor by stage; the last base has the first fields."""


THRESHOLDS = Thresholds()
"""The values in use."""


def table(names: Collection[str]) -> str:
    """A Markdown table of some thresholds; raises ValueError for a name that is none."""
    known = {each.name: each for each in fields(Thresholds)}
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"no threshold {unknown[0]!r}")
    rows = [
        f"| `{name}` | {getattr(THRESHOLDS, name):g} | {known[name].metadata['unit']} "
        f"| {known[name].metadata['meaning']} | {known[name].metadata['source']} |"
        for name in names
    ]
    return "\n".join(["| name | value | unit | meaning | source |", "|---|---|---|---|---|", *rows])


def described(stages: set[Stage]) -> list[dict[str, Any]]:
    """Name, value, unit, meaning and source of the thresholds of some stages, for report.json."""
    return [
        {
            "name": each.name,
            "value": getattr(THRESHOLDS, each.name),
            "unit": each.metadata["unit"],
            "meaning": each.metadata["meaning"],
            "source": each.metadata["source"],
        }
        for each in fields(Thresholds)
        if each.metadata["stage"] in stages
    ]
