"""How hypotheses stood in cases of the foreign study, beside the truth."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acqd.discrepancy.causes.belief import NOTHING, OUTSIDE, Belief
from acqd.discrepancy.selection.standing import Standing
from tools.studies.foreign.generator.hidden.catalogue import OUTSIDE as UNKNOWN
from tools.studies.foreign.judge import families
from tools.studies.foreign.runner import result_files


@dataclass(frozen=True, slots=True)
class Row:
    """A case with one hidden effect, or none."""

    world: str
    case: str
    strength: int
    """Percent of the dynamic range; 0 for a clean case."""
    true: frozenset[str]
    """Labels that are right."""
    standing: Standing
    said: Belief
    """In the report."""
    led: bool
    """Whether the belief follows the confidence in a selected effect, and not the standing."""

    @property
    def family(self) -> str:
        """Plants of a kind: the world without its seed."""
        return self.world.rpartition("-seed")[0]


def read(out: Path, label: str) -> Iterator[Row]:
    """Cases with one hidden effect or none; those that the loop refused have no standing and are left out."""
    for path in result_files(out, label):
        result = json.loads(path.read_text())
        causes = (result["report"] or {}).get("causes")
        if causes and len(result["truth"]) < 2:
            yield row_of(result, causes)


def row_of(result: dict[str, Any], causes: dict[str, Any]) -> Row:
    """A row of a result of the study, and what its report says of causes."""
    truth = [effect["id"] for effect in result["truth"]]
    return Row(
        result["world"], result["case"], int(result["strength"]), labels(truth),
        Standing.from_json(causes["scores"]), Belief(causes["probabilities"], tuple(causes["set"])),
        causes.get("follows") == "confidence",
    )  # fmt: skip


def labels(truth: list[str]) -> frozenset[str]:
    """Labels that are right for hidden effects; names that mean the same are right too, wherever they are."""
    if not truth:
        return frozenset({NOTHING})
    if any(effect in UNKNOWN for effect in truth):
        return frozenset({OUTSIDE})
    same = {family["named"] for family in families() if family["true"] in truth}
    return frozenset({*truth, *same})
