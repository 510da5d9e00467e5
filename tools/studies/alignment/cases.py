"""Cases of the study: a campaign behind a supply, with a clock that is off, drifts, and is sometimes set."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.placement import Alignment, place
from acqd.dataset.regressors import regressors_of
from acqd.robot.description import load_description
from acqd.robot.log import RobotLog
from tools.studies.alignment.bed import Campaign, Supply, metered

SUPPLIES = (*(Supply(lag_s) for lag_s in (0.0, 0.008, 0.015, 0.033, 0.06)), Supply(0.0, 0.03), Supply(0.0, 0.06))
_DRIFT_PPM = 30.0
_STEP_S = 0.06
_SET_EVERY = 3  # cases


@dataclass(frozen=True, slots=True)
class Result:
    """What the alignment made of one case."""

    axes: int
    supply: Supply
    errors_s: Floats
    """[n] found minus true lag; NaN where the log was refused."""
    within_s: Floats
    """[n] half the width of the stated 95 % interval."""
    announced: bool
    """Whether a note says that lags are uncertain, or which logs they are."""
    was_set: bool
    """Whether the clock was set during the campaign."""
    steps_found: int
    supply_s: float


def run_case(played: Campaign, supply: Supply, seed: int, number: int, cache: Path) -> Result:
    """One case. Its logs have no torques, those of six axes no signals either.

    A pure delay is part of the true lag: no log can tell it from a clock offset.
    """
    random = np.random.default_rng([seed, number, played.cell.robot.axes])
    offset_s, drift = float(random.uniform(-2, 2)), float(random.normal(0, _DRIFT_PPM)) * 1e-6
    was_set = number % _SET_EVERY == 0
    first = int(random.integers(2, len(played.logs) - 2)) if was_set else len(played.logs)
    offsets = offset_s + _STEP_S * (np.arange(len(played.logs)) >= first)
    logs = [_clocked(log, played, offset, drift) for log, offset in zip(played.logs, offsets.tolist(), strict=True)]
    true = offsets + drift * played.middles - supply.delay_s
    robot = played.cell.robot
    regressors = [regressors_of(log, robot) for log in logs]
    found = place(regressors, metered(played, supply, cache), 2.4, lambda _: None, [log.path.stem for log in logs])
    return _result(found, true, supply, robot.axes, was_set)


def _clocked(log: RobotLog, played: Campaign, offset_s: float, drift: float) -> RobotLog:
    robot = played.cell.robot
    time = log.time * (1 + drift) + offset_s
    if any(layout.format == "datarecorder" for layout in load_description(robot.name).log):
        time = np.floor(1000 * time) / 1000  # a DataRecorder writes whole milliseconds
    return replace(log, time=time, tau=None, current=None, signals=log.signals if robot.axes > 6 else {})


def _result(found: Alignment, true: Floats, supply: Supply, axes: int, was_set: bool) -> Result:
    placed = found.placements
    errors = np.array([p.lag_s - t if p.method != "refused" else np.nan for p, t in zip(placed, true, strict=True)])
    within = np.array([p.within_s or 0.0 for p in placed])
    announced = any("uncertain" in note for note in [*found.notes, *(p.note for p in placed)])
    steps = len(found.line.steps) if found.line else 0
    return Result(axes, supply, errors, within, announced, was_set, steps, found.supply_lag_s)
