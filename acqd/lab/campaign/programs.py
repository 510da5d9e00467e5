"""The program of each recording: a source trajectory, or an assembly and its imitation by the digital twin."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.atomic import naming
from acqd.lab.campaign.folders import Folders
from acqd.lab.campaign.use_case import Assembly
from acqd.lab.cell import MOTION, Cell
from acqd.lab.schedule import RecordingPlan
from acqd.motion.controller import Controller, Step
from acqd.motion.trajectory import Trajectory, read_trajectory

_TWIN_PERIOD_MS = 40


class Programs:
    """Programs of one cell. Trajectories are read, and assemblies planned, when they are first needed."""

    def __init__(self, cell: Cell, folders: Folders) -> None:
        self._cell = cell
        self._folders = folders
        self._sources: dict[str, Trajectory] = {}
        self._robot: Assembly | None = None
        self._twin: Assembly | None = None

    def start(self, recording: RecordingPlan) -> Floats:
        """Joint position at which the recording starts, [axes] rad."""
        if recording.source == 0:
            return self._assembly().home()
        first: Floats = self._source(recording).waypoints[0]
        return first

    def program(self, recording: RecordingPlan) -> list[Step]:
        """The program; speeds and blending are drawn for every recording separately."""
        random = self._cell.random(MOTION, recording.number, 1)
        if recording.source == 0:
            return self._assembly().program(random)
        return self._cell.planner.program(self._source(recording), random)

    def imitate(self, recording: RecordingPlan) -> None:
        """Write the digital twin's motion of an assembly: exact joint angles every 40 ms, no torques."""
        if recording.source:
            return
        cell = self._cell
        if self._twin is None:
            self._twin = Assembly(cell.arm, cell.planner, "twin")
        folder = self._folders.twin(cell.device)
        folder.mkdir(parents=True, exist_ok=True)
        random = cell.random(MOTION, recording.number, 1)
        motion = Controller(cell.robot, self._twin.home()).run(self._twin.program(random))
        stamps = np.arange(0, len(motion), _TWIN_PERIOD_MS)
        header = ",".join(["time", *(f"q{k + 1}" for k in range(cell.robot.axes))])
        lines = [",".join([f"{k / 1000:.3f}", *(f"{value:.7g}" for value in motion.q[k])]) for k in stamps]
        with naming(path := folder / f"{recording.name}.csv"):
            path.write_text("\n".join([header, *lines, ""]), encoding="utf-8")

    def _assembly(self) -> Assembly:
        if self._robot is None:
            self._robot = Assembly(self._cell.arm, self._cell.planner)
        return self._robot

    def _source(self, recording: RecordingPlan) -> Trajectory:
        name = recording.source_name
        if name not in self._sources:
            self._sources[name] = read_trajectory(self._folders.trajectories / f"{name}.csv", self._cell.robot)
        return self._sources[name]
