"""The whole fleet: screen every robot, control false discoveries, find causes, and what they share."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from acqd.fleet.cause import Search
from acqd.fleet.job import CauseTask, Result, ScreenTask, find_cause, screen_robot
from acqd.fleet.settings import Fleet
from acqd.fleet.summary import FleetReport, Row, judged, report_of
from acqd.fleet.write import claimed, write_report
from acqd.workers import run_here, run_on_ray

Engine = Literal["process", "ray"]
Progress = Callable[[str, float], None]
_SCREENING = 0.5
"""Share of the progress after which all robots are screened."""


@dataclass(frozen=True, slots=True)
class FleetConfig:
    """What to do, where to, and which processes do the work."""

    fleet: Fleet
    out: Path
    jobs: int = 1
    engine: Engine = "process"
    ray_address: str | None = None
    EUR_per_kWh: float | None = None
    """Mean price; None: energies of causes have no cost."""


def run_fleet(config: FleetConfig, progress: Progress) -> FleetReport:
    """Judge every robot; results of an earlier run with the same inputs are used again. Raises UserError.

    Raises OperationError when a worker process was killed; what was finished until then is kept.
    """
    fleet, out = config.fleet, config.out.absolute()
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # one thread per worker
    with claimed(out):
        tasks = [ScreenTask(robot, out / "robots" / robot.name) for robot in fleet.robots]
        screened = _all(config, screen_robot, tasks, _shown(progress, "screening", 0.0, _SCREENING))
        rows = judged([screened[robot.name] for robot in fleet.robots], fleet.settings)
        causes = _cause_tasks(fleet, tasks, {row["name"]: row for row in rows if row["state"] == "changed"})
        found = _all(config, find_cause, causes, _shown(progress, "closing the loop", _SCREENING, 1.0))
        progress("writing", 1.0)
        report = report_of(fleet, rows, found, config.EUR_per_kWh)
        write_report(out, fleet, report)
        return report


def _cause_tasks(fleet: Fleet, tasks: list[ScreenTask], changed: dict[str, Row]) -> list[CauseTask]:
    rows = [(task, changed[task.robot.name]) for task in tasks if task.robot.name in changed]
    search = Search(fleet.settings.max_effects, tuple(fleet.settings.only), fleet.settings.seed)
    return [CauseTask(task.robot, task.folder, Path(row["dataset"]), row["screen"], search) for task, row in rows]


def _shown(progress: Progress, what: str, begin: float, end: float) -> Callable[[int, int], None]:
    """Progress of one stage, from the numbers of done and of all robots."""
    return lambda done, count: progress(f"{what}: {done} of {count} robots", begin + (end - begin) * done / count)


def _all(
    config: FleetConfig, work: Callable[[Any], Result], tasks: list[Any], show: Callable[[int, int], None]
) -> dict[str, Result]:
    """Results by the robot's name."""
    results: dict[str, Result] = {}
    if not tasks:
        return results

    def tick() -> None:
        show(len(results), len(tasks))

    tick()
    if config.engine == "ray":
        done = run_on_ray(work, tasks, config.ray_address, tick)
    else:
        done = run_here(work, tasks, config.jobs, tick)
    for result in done:
        results[result["name"]] = result
        tick()
    return results
