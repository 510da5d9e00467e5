"""One session of a campaign as a unit of work that any process, here or on a cluster, can do."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.errors import OperationError
from acqd.lab.cell import MOTION, Cell, build_cell
from acqd.lab.instruments.data_recorder import log_suffix
from acqd.lab.instruments.row_file import RowFile
from acqd.lab.motion.controller import Controller, Phase, Step, Wait
from acqd.lab.motion.trajectory import Trajectory, read_trajectory
from acqd.lab.motion.use_case import Assembly
from acqd.lab.schedule import RecordingPlan, SessionPlan, room_s
from acqd.lab.session import RecordingTruth, Session, SessionTruth, windows_within
from acqd.lab.settings import CampaignSettings


@dataclass(frozen=True, slots=True)
class Folders:
    """Where a campaign keeps its parts."""

    out: Path
    """Public: logs, trajectories, manifest, database."""
    truth: Path
    """Nothing that analyses may look in here."""

    def logs(self, device: str) -> Path:
        """Robot logs of one cell."""
        return self.out / "logs" / device

    def twin(self, device: str) -> Path:
        """Motions of one cell's digital twin."""
        return self.out / "twin" / device

    @property
    def trajectories(self) -> Path:
        """Source trajectories."""
        return self.out / "trajectories"

    @property
    def work(self) -> Path:
        """Sessions done but not yet in the database."""
        return self.truth / "work"


def run_session(settings: CampaignSettings, plan: SessionPlan, folders: Folders) -> dict[str, Any]:
    """Do one session: logs, row file, truth. Its report is written last, so that half a session is none."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    cell = build_cell(settings, plan.cell)
    for folder in (folders.logs(cell.device), folders.work):
        folder.mkdir(parents=True, exist_ok=True)
    rows = RowFile(folders.work / f"{plan.name}.jsonl", cell.device, plan.boot(settings))
    complete = False
    try:
        truth = _play(cell, plan, folders, settings, rows)
        complete = True
    finally:
        rows.close(complete=complete)
    np.savez_compressed(
        folders.truth / f"{plan.name}.npz",
        start_utc_ns=np.int64(truth.start_utc_ns),
        window_s=np.float64(truth.window_s),
        P_W=truth.power,
        P_without_effects_W=truth.clean_power,
        P_metered_W=truth.metered,
    )
    report = _report(cell, plan, truth) | {"boot": plan.boot(settings)}
    finished = folders.work / f"{plan.name}.json"
    temporary = finished.with_suffix(f".{os.getpid()}")
    temporary.write_bytes(orjson.dumps(report, option=orjson.OPT_SERIALIZE_NUMPY))
    temporary.replace(finished)
    return report


def _play(cell: Cell, plan: SessionPlan, folders: Folders, settings: CampaignSettings, rows: RowFile) -> SessionTruth:
    programs = _Programs(cell, folders)
    start_utc_ns = settings.start_utc_ns + round(plan.start_s * 1e9)
    session = Session(cell, plan.number, start_utc_ns, programs.start(plan.recordings[0]), rows.write)
    for place, recording in enumerate(plan.recordings):
        way = cell.planner.connect(session.controller.position, programs.start(recording))
        pause = settings.pause_s if place else 3.0
        session.pause([Phase("transfer"), *way, Wait(pause)], recording.number)
        log = folders.logs(cell.device) / (recording.name + log_suffix(cell.robot))
        session.record(programs.program(recording), recording.number, recording.name, log)
        programs.imitate(recording)
    truth = session.finish()
    if session.elapsed_s > room_s(settings, len(plan.recordings)):
        raise OperationError(
            f"session {plan.name} took {session.elapsed_s:.0f} s of simulated time; slow motions need fewer waypoints"
        )
    return truth


class _Programs:
    """What is executed in each recording."""

    def __init__(self, cell: Cell, folders: Folders) -> None:
        self._cell = cell
        self._folders = folders
        self._sources: dict[str, Trajectory] = {}
        self._robot: Assembly | None = None
        self._twin: Assembly | None = None

    def start(self, recording: RecordingPlan) -> Floats:
        """Where it begins [axes]."""
        if recording.source == 0:
            return self._assembly().home()
        first: Floats = self._source(recording).waypoints[0]
        return first

    def program(self, recording: RecordingPlan) -> list[Step]:
        """Random motion parameters, other ones in every recording."""
        random = self._cell.random(MOTION, recording.number, 1)
        if recording.source == 0:
            return self._assembly().program(random)
        return self._cell.planner.program(self._source(recording), random)

    def imitate(self, recording: RecordingPlan) -> None:
        """The twin's motion of the same assembly, logged by the twin itself: exact angles, no torques."""
        if recording.source:
            return
        cell = self._cell
        if self._twin is None:
            self._twin = Assembly(cell.arm, cell.planner, "twin")
        folder = self._folders.twin(cell.device)
        folder.mkdir(parents=True, exist_ok=True)
        random = cell.random(MOTION, recording.number, 1)
        motion = Controller(cell.robot, self._twin.home()).run(self._twin.program(random))
        stamps = np.arange(0, len(motion), 40)
        header = ",".join(["time", *(f"q{k + 1}" for k in range(cell.robot.axes))])
        lines = [",".join([f"{k / 1000:.3f}", *(f"{value:.7g}" for value in motion.q[k])]) for k in stamps]
        (folder / f"{recording.name}.csv").write_text("\n".join([header, *lines, ""]), encoding="utf-8")

    def _assembly(self) -> Assembly:
        if self._robot is None:
            self._robot = Assembly(self._cell.arm, self._cell.planner)
        return self._robot

    def _source(self, recording: RecordingPlan) -> Trajectory:
        name = recording.source_name
        if name not in self._sources:
            self._sources[name] = read_trajectory(self._folders.trajectories / f"{name}.csv", self._cell.robot)
        return self._sources[name]


def _report(cell: Cell, plan: SessionPlan, truth: SessionTruth) -> dict[str, Any]:
    windows = min(len(truth.power), len(truth.metered))
    power, metered = truth.power[:windows], truth.metered[:windows]
    return {
        "session": plan.name,
        "device": cell.device,
        "seconds": truth.energy["seconds"],
        "windows": windows,
        "energy": truth.energy,
        "steady": steady_error(power, metered, truth.window_s),
        "standby_W": float(np.median(metered[: round(1.5 / truth.window_s)])),
        "recordings": [asdict(recording) | _figures(truth, recording, plan) for recording in truth.recordings],
    }


def _figures(truth: SessionTruth, recording: RecordingTruth, plan: SessionPlan) -> dict[str, Any]:
    space = next(planned.space for planned in plan.recordings if planned.number == recording.number)
    part = windows_within(recording.start_s, recording.seconds, truth.window_s)
    hidden = truth.power[part] - truth.clean_power[part]
    return {
        "space": space,
        "hidden_W": {"mean": float(hidden.mean()), "rms": float(np.sqrt(np.mean(hidden**2)))},
    }


def steady_error(power: Floats, metered: Floats, window_s: float = 0.04, calm_W: float = 6.0) -> dict[str, float]:
    """Metered against true power while the arm stands: per window, and per second.

    Steady is a second in which the true mean power of its windows stays within `calm_W`, which the standby
    load's own fluctuation does and a moving arm does not. A metered window ends up to one mains cycle before
    its end; what changes in that time shows per window and averages out per second.
    """
    per_second = round(1 / window_s)
    seconds = len(power) // per_second
    true, read = (values[: seconds * per_second].reshape(seconds, per_second) for values in (power, metered))
    calm = (np.ptp(true, axis=1) < calm_W) & np.isfinite(read).all(axis=1)
    if not calm.any():
        return {"windows": 0, "window_rms": 0.0, "window_worst": 0.0, "second_worst": 0.0}
    window = read[calm] / true[calm] - 1.0
    second = read[calm].mean(axis=1) / true[calm].mean(axis=1) - 1.0
    return {
        "windows": int(calm.sum()) * per_second,
        "window_rms": float(np.sqrt(np.mean(window**2))),
        "window_worst": float(np.abs(window).max()),
        "second_worst": float(np.abs(second).max()),
    }
