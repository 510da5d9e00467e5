"""Files of the robots: a model of each as it was, power rows and logs of the time in question."""

from __future__ import annotations

import json
import shutil
import sqlite3
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd.dataset.build import BuildConfig, build
from acqd.dataset.power import open_power
from acqd.models.config import GREY_BOX, TrainConfig
from acqd.models.training import train_one
from acqd.storage.database import open_database
from acqd.storage.schema import power as power_table
from acqd.timestamps import filetime, rfc3339
from tools.studies.fleet.cases import TYPE, Case, Scale, Secret, hidden_in, plant_of
from tools.studies.foreign.generator.plant import Session
from tools.studies.foreign.generator.recordings import Clock, write

START_S = 1_767_600_000.0
"""Unix time of the training of all robots; a week later they are all in question at the same time."""
LATER_S = START_S + 7 * 86_400


@dataclass(frozen=True, slots=True)
class MakeTask:
    """One robot."""

    scale: Scale
    case: Case
    out: Path


def make_robot(task: MakeTask) -> str:
    """Write a robot's bundle and files, unless they are there. Returns its name."""
    folder = task.out / "robots" / task.case.name
    done = folder / "secret.json"
    if not done.exists():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        _train(task, folder)
        secret = _record(task.scale, task.case, task.scale.minutes, folder / "now", LATER_S)
        partial = done.with_suffix(".part")
        partial.write_text(json.dumps(secret))
        partial.rename(done)
    return task.case.name


def secret_of(out: Path, case: Case) -> dict[str, Any]:
    """What was hidden in a robot that has been made."""
    path = out / "robots" / case.name / "secret.json"
    if not path.exists():
        sys.exit(f"{path}: is missing; run the same command with --phase make first")
    return dict(json.loads(path.read_text()))


def record(
    scale: Scale, case: Case, minutes: float, folder: Path, start_s: float, *, key: int
) -> tuple[Session, Secret]:
    """Power rows and logs of a session in `folder`."""
    random = np.random.default_rng([scale.seed, key, case.number])
    session = Session.drawn(plant_of(scale, case.number), scale.plan(minutes), random)
    secret = hidden_in(session, case, scale)
    write(session, secret.doses, folder, start_s, Clock(), torques=False, random=random)
    return session, secret


def dataset_of(files: Path, out: Path) -> Path:
    """The dataset of a session; clocks agree."""
    build(BuildConfig(str(files / "power.csv"), files / "logs", out, TYPE, lag_s=0.0), _quiet)
    return out


def train(dataset: Path, out: Path, **more: Any) -> dict[str, Any]:
    """A grey box."""
    return train_one(TrainConfig(dataset, GREY_BOX, out, **more), _quiet)


def _record(scale: Scale, case: Case, minutes: float, folder: Path, start_s: float) -> dict[str, Any]:
    _, secret = record(scale, case, minutes, folder, start_s, key=19)
    _into_sqlite(folder / "power.csv", folder / "power.sqlite", case.name)
    place = secret.doses[0].effect.place if secret.doses else None
    onset = None if secret.onset_s is None else start_s + secret.onset_s
    return {"cause": case.cause, "shared": case.shared, "place": place, "onset_s": onset, "strength": secret.strength}


def _into_sqlite(rows: Path, database: Path, device: str) -> None:
    """Power rows as a sink stores them, labelled simulated; they replace the file of rows."""
    stream = open_power(str(rows), None, None)
    open_database(str(database)).dispose()  # the tables
    columns = ("device", "channel", "boot", "seq", "time", "filetime", "Vrms", "P", "flags", "schema")
    values = zip(stream.time_ns.tolist(), stream.Vrms.tolist(), stream.P.tolist(), strict=True)
    stored = (
        (device, "total", "study", seq, rfc3339(ns), filetime(ns), volts, watts, '["simulated"]', 1)
        for seq, (ns, volts, watts) in enumerate(values)
    )
    marks = ", ".join("?" * len(columns))
    connection = sqlite3.connect(database)
    with connection:
        connection.executemany(f"INSERT INTO {power_table.name} ({', '.join(columns)}) VALUES ({marks})", stored)
    connection.close()
    rows.unlink()


def _train(task: MakeTask, folder: Path) -> None:
    unchanged = Case(task.case.number, None, shared=False)
    record(task.scale, unchanged, task.scale.reference, folder / "before", START_S, key=17)
    train(dataset_of(folder / "before", folder / "before.ds"), folder / "model")
    for name in ("before", "before.ds"):  # a third of the study's bytes, which nothing needs again
        shutil.rmtree(folder / name)


def _quiet(*_: object) -> None:
    """No progress from workers."""


def write_fleet(out: Path, cases: list[Case]) -> Path:
    """The fleet's file."""
    path = out / "fleet.toml"
    lines = ["[defaults]", 'model = "robots/{name}/model"', 'power = "robots/{name}/now/power.sqlite"']
    lines += ['logs = "robots/{name}/now/logs"', "lag_s = 0", *(f"[robots.{case.name}]" for case in cases)]
    path.write_text("\n".join([*lines, ""]))
    return path
