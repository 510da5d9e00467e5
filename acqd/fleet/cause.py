"""The loop on one robot that has changed: the cause in a few plain keys, and the full report beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.discrepancy.report.summary import as_json
from acqd.discrepancy.report.write import write_all
from acqd.errors import InputError, UserError
from acqd.fleet.robot import FleetRobot

_KEPT = ("verdict", "effects", "correction", "before", "after", "unexplained", "next", "notes", "joint_names")


@dataclass(frozen=True, slots=True)
class Search:
    """How causes are searched."""

    max_effects: int
    only: tuple[str, ...]
    """Effects that compete; empty: all."""
    seed: int


def close(robot: FleetRobot, dataset: Path, folder: Path, screened: dict[str, Any], search: Search) -> dict[str, Any]:
    """Close the loop on the recordings since the onset; the report goes to `folder`/loop.

    Too few recordings give the verdict not_identifiable with a `reason`. Raises OperationError.
    """
    since_s = screened["onset_s"] if screened["onset_s"] >= screened["first_end_s"] else None
    config = CloseConfig(
        dataset, robot.model, folder / "loop", max_effects=search.max_effects, only=search.only, seed=search.seed,
        robot=robot.description, since_s=since_s,
    )  # fmt: skip
    try:
        closed = close_loop(config, lambda *_: None)
    except (UserError, InputError) as error:
        return {"verdict": "not_identifiable", "effects": [], "reason": str(error), "report": None}
    write_all(config, closed)
    report = as_json(config, closed)
    return {**{key: report[key] for key in _KEPT}, "reason": None, "report": str(folder / "loop" / "report.html")}
