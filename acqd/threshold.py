"""A threshold: a value with unit, stage, source and meaning, which reports and the page of the method list.

Sources: "convention" is common statistical practice; "choice" is a definition that could have been made otherwise;
"study" was set by hand on simulated plants while the methods were developed, with seeds that nobody recorded, and
`python -m tools.studies.effects` judges the result on other campaigns; "physics" follows from what robots do.
Grids of searches (starting values, dwell times) and numerical floors stay with their methods.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import field, fields
from typing import Any, Literal

Stage = Literal["recordings", "delay", "noise", "detectors", "selection", "uncertainty", "verdict", "joints", "monitor"]
"""Of the method."""


def threshold(value: float, unit: str, stage: Stage, source: str, meaning: str) -> Any:
    """A field of a frozen dataclass of thresholds; `source` is convention, choice, study or physics."""
    metadata = {"unit": unit, "stage": stage, "source": source, "meaning": meaning}
    return field(default=value, metadata=metadata)


def described(groups: Sequence[Any], stages: Collection[Stage]) -> list[dict[str, Any]]:
    """Name, value, unit, meaning and source of the thresholds of some stages, from dataclasses of thresholds."""
    return [
        {
            "name": each.name,
            "value": getattr(group, each.name),
            "unit": each.metadata["unit"],
            "meaning": each.metadata["meaning"],
            "source": each.metadata["source"],
        }
        for group in groups
        for each in fields(group)
        if each.metadata["stage"] in stages
    ]


def table(thresholds: Sequence[dict[str, Any]]) -> str:
    """A Markdown table of described thresholds."""
    rows = [
        f"| `{each['name']}` | {each['value']:g} | {each['unit']} | {each['meaning']} | {each['source']} |"
        for each in thresholds
    ]
    return "\n".join(["| name | value | unit | meaning | source |", "|---|---|---|---|---|", *rows])
