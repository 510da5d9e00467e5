"""What the fleet's prior is worth: the held-out error of a new robot by minutes of its own data, with and without."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd.fleet.config import read_fleet
from acqd.fleet.prior import priors_of
from acqd.models.bundle.restore import open_model
from acqd.models.greybox.fleet_prior import FleetPrior
from acqd.models.metrics import predictions
from acqd.models.segments import Dataset, load_dataset
from acqd.workers import run_here
from tools.studies.fleet.cases import TYPE, Case, Scale
from tools.studies.fleet.make import LATER_S, START_S, dataset_of, record, train

_HELD_OUT = 1 / 3
"""Length of the other session, as a share of the whole."""
_FIRST_NUMBER = 10_000
"""Robots of which the fleet has no bundle."""


@dataclass(frozen=True, slots=True)
class _NewRobot:
    """A robot of which the fleet has no bundle, and the prior that is judged on it."""

    scale: Scale
    prior: FleetPrior
    folder: Path
    number: int
    minutes: tuple[float, ...]


def benefit(
    scale: Scale, fleet: Path, out: Path, robots: int, minutes: tuple[float, ...], jobs: int
) -> list[dict[str, Any]]:
    """One entry per new robot: W RMS of another session, by training on `minutes`, of which the first is the whole.

    Their recordings are kept; the models are fitted again by every call.
    """
    prior = priors_of(read_fleet(fleet))[TYPE]
    tasks = [_NewRobot(scale, prior, out / f"new-{k}", _FIRST_NUMBER + k, minutes) for k in range(robots)]
    return sorted(run_here(_judged, tasks, jobs, lambda: None), key=lambda each: str(each["robot"]))


def _judged(new: _NewRobot) -> dict[str, Any]:
    _record(new)
    later = load_dataset(new.folder / "later.ds")
    result: dict[str, Any] = {"robot": Case(new.number, None, shared=False).name, "rms_W": {}}
    for amount in new.minutes:
        dataset = _first_minutes(new.folder, amount, amount / new.minutes[0])
        for name, learned in (("alone", None), ("with the prior", new.prior)):
            bundle = new.folder / f"model-{amount:g}-{name.split()[0]}"
            shutil.rmtree(bundle, ignore_errors=True)
            train(dataset, bundle, learned=learned)
            result["rms_W"][f"{amount:g} min {name}"] = _rms(bundle, later)
    return result


def _record(new: _NewRobot) -> None:
    """Two sessions of the robot, unless they are there."""
    done = new.folder / "recorded"
    if done.exists() and done.read_text() == str(new.minutes[0]):
        return
    shutil.rmtree(new.folder, ignore_errors=True)
    case = Case(new.number, None, shared=False)
    record(new.scale, case, new.minutes[0], new.folder / "own", START_S, key=23)
    record(new.scale, case, _HELD_OUT * new.minutes[0], new.folder / "later", LATER_S, key=29)
    dataset_of(new.folder / "later", new.folder / "later.ds")
    done.write_text(str(new.minutes[0]))


def _first_minutes(folder: Path, minutes: float, share: float) -> Path:
    """A dataset of the first recordings of a robot."""
    dataset = folder / f"first-{minutes:g}.ds"
    if dataset.exists():
        return dataset
    part = folder / f"first-{minutes:g}"
    (part / "logs").mkdir(parents=True)
    (part / "power.csv").symlink_to(folder / "own" / "power.csv")
    logs = sorted((folder / "own" / "logs").iterdir())
    for log in logs[: max(round(len(logs) * share), 3)]:
        (part / "logs" / log.name).symlink_to(log)
    return dataset_of(part, dataset)


def _rms(bundle: Path, data: Dataset) -> float:
    """W, of errors about the mean of each recording: the standby wanders from day to day for every model alike."""
    _, model = open_model(bundle)
    errors = [s.P - predicted for s, predicted in zip(data.segments, predictions(model, data.segments), strict=True)]
    return float(np.sqrt(np.concatenate([(error - error.mean()) ** 2 for error in errors]).mean()))
