"""What the fleet's prior is worth: the held-out error of a new robot by minutes of its own data, with and without."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from acqd.fleet.config import read_fleet
from acqd.fleet.prior import priors_of
from acqd.models.bundle.restore import open_model
from acqd.models.greybox.fleet_prior import FleetPrior
from acqd.models.metrics import predictions
from acqd.models.segments import Dataset, load_dataset
from tools.studies.fleet.cases import TYPE, Case, Scale
from tools.studies.fleet.make import LATER_S, START_S, dataset_of, record, train

WHOLE_MIN = 60.0
HELD_OUT_MIN = 20.0
_FIRST_NUMBER = 10_000
"""Robots of which the fleet has no bundle."""


def benefit(scale: Scale, fleet: Path, out: Path, robots: int, minutes: tuple[float, ...]) -> list[dict[str, Any]]:
    """One entry per new robot: W RMS of another session, by training."""
    prior = priors_of(read_fleet(fleet))[TYPE]
    return [_of(scale, prior, out / f"new-{k}", _FIRST_NUMBER + k, minutes) for k in range(robots)]


def _of(scale: Scale, prior: FleetPrior, folder: Path, number: int, minutes: tuple[float, ...]) -> dict[str, Any]:
    done = folder / "benefit.json"
    if done.exists():
        return dict(orjson.loads(done.read_bytes()))
    shutil.rmtree(folder, ignore_errors=True)
    case = Case(number, None, shared=False)
    record(scale, case, WHOLE_MIN, folder / "own", START_S, key=23)
    record(scale, case, HELD_OUT_MIN, folder / "later", LATER_S, key=29)
    later = load_dataset(dataset_of(folder / "later", folder / "later.ds"))
    result: dict[str, Any] = {"robot": case.name, "rms_W": {}}
    for amount in (WHOLE_MIN, *minutes):
        dataset = _first_minutes(folder, amount)
        for name, learned in (("alone", None), ("with the prior", prior)):
            bundle = folder / f"model-{amount:g}-{name.split()[0]}"
            train(dataset, bundle, learned=learned)
            result["rms_W"][f"{amount:g} min {name}"] = _rms(bundle, later)
    shutil.rmtree(folder / "own")
    done.write_bytes(orjson.dumps(result))
    return result


def _first_minutes(folder: Path, minutes: float) -> Path:
    """A dataset of the first recordings of a robot."""
    part = folder / f"first-{minutes:g}"
    (part / "logs").mkdir(parents=True)
    (part / "power.csv").symlink_to(folder / "own" / "power.csv")
    logs = sorted((folder / "own" / "logs").iterdir())
    for log in logs[: max(round(len(logs) * minutes / WHOLE_MIN), 3)]:
        (part / "logs" / log.name).symlink_to(log)
    return dataset_of(part, folder / f"first-{minutes:g}.ds")


def _rms(bundle: Path, data: Dataset) -> float:
    """W, of errors about the mean of each recording: the standby wanders from day to day for every model alike."""
    _, model = open_model(bundle)
    errors = [s.P - predicted for s, predicted in zip(data.segments, predictions(model, data.segments), strict=True)]
    return float(np.sqrt(np.concatenate([(error - error.mean()) ** 2 for error in errors]).mean()))
