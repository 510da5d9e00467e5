"""A set of source trajectories: drawn at random, written as CSV files with a manifest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import orjson

from acqd import __version__
from acqd.atomic import naming
from acqd.lab.cell import Cell
from acqd.motion.excitation import Tally
from acqd.motion.trajectory import Trajectory, write_trajectory

MANIFEST = "trajectories.json"
_LIMITED, _ALL = 101, 102  # streams of random numbers


@dataclass(frozen=True, slots=True)
class TrajectorySet:
    """Trajectories of both algorithms, with the counts of rejected draws."""

    limited: list[Trajectory]
    all_space: list[Trajectory]
    limited_tally: Tally
    all_space_tally: Tally
    thesis: bool
    """Collisions were checked at only 10 points of each motion."""

    def summary(self) -> dict[str, Any]:
        """Counts for the manifest and the report."""
        return {
            "limited": {"trajectories": len(self.limited)} | asdict(self.limited_tally),
            "all": {"trajectories": len(self.all_space)} | asdict(self.all_space_tally),
        }


def draw(
    cell: Cell,
    *,
    limited: int,
    all_space: int,
    thesis: bool = False,
    progress: Callable[[float], None] | None = None,
) -> TrajectorySet:
    """Draw trajectories for one cell's robot and scene. `progress` takes the share done. Raises UserError."""
    report_progress = progress or (lambda _: None)
    drawn: dict[str, list[Trajectory]] = {"limited": [], "all": []}
    confined, free = cell.excitation(thesis=thesis), cell.excitation(thesis=thesis)
    for number in range(1, limited + 1):
        name = f"limited_{number:02d}"
        drawn["limited"].append(confined.limited_space(name, cell.cube(), cell.settings.random(_LIMITED, number)))
        report_progress(number / (limited + all_space))
    for number in range(1, all_space + 1):
        drawn["all"].append(free.all_space(f"all_{number:02d}", cell.settings.random(_ALL, number)))
        report_progress((limited + number) / (limited + all_space))
    return TrajectorySet(drawn["limited"], drawn["all"], confined.tally, free.tally, thesis)


def write(trajectories: TrajectorySet, cell: Cell, folder: Path) -> None:
    """Write the CSV files, and the manifest last: a folder with a manifest is complete."""
    folder.mkdir(parents=True, exist_ok=True)
    for trajectory in [*trajectories.limited, *trajectories.all_space]:
        write_trajectory(folder / f"{trajectory.name}.csv", trajectory, cell.robot)
    manifest = {"acqd": __version__, "robot": cell.robot.name, "scene": cell.scene.name}
    manifest["checked_at"] = "10 points" if trajectories.thesis else "2 deg"
    with naming(folder / MANIFEST):
        (folder / MANIFEST).write_bytes(orjson.dumps(manifest | trajectories.summary(), option=orjson.OPT_INDENT_2))
