"""Robot logs that arrive while faults happen, and whether the sidecar has done each exactly once (simulated robot)."""

from __future__ import annotations

import importlib
import random
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import sqlalchemy as sa

from tools.studies.sidecar.arrival import arrive
from tools.studies.sidecar.judge import done_logs

LOG_DEVICE = "cell"
"""Meter of the robot; its rows are in the database before the logs arrive."""
LOGS = 24
"""Logs that can arrive."""


@dataclass(frozen=True, slots=True)
class LogsDone:
    """What became of the logs."""

    arrived: int
    done: int
    refused: int
    incomplete: int
    """Rows of the prediction are missing or too many."""
    unpublished: int

    @property
    def wrong(self) -> int:
        """Logs that were not done exactly once, with all rows, and published."""
        return abs(self.arrived - self.done) + self.refused + self.incomplete + self.unpublished


class RobotLogs:
    """Logs that are ready to arrive in a folder that the sidecar watches."""

    def __init__(self, folder: Path, model: Path) -> None:
        self.folder, self.model = folder, model
        self._ready = folder.with_name("logs-ready")
        self._arrived: list[threading.Thread] = []

    def prepare(self, engine: sa.Engine) -> None:
        """Write bundle, logs and the rows of their power."""
        self.folder.mkdir()
        self._ready.mkdir()
        simulated = importlib.import_module("tests.sidecar.cell")  # tests are not typed
        simulated.write_bundle(self.model)
        simulated.cell(self._ready, engine.url.render_as_string(hide_password=False), LOGS)

    def arrive(self, chance: random.Random) -> None:
        """One more log arrives within the next seconds."""
        waiting = sorted(self._ready.iterdir())
        if len(self._arrived) < len(waiting):
            source, seed = waiting[len(self._arrived)], chance.random()
            thread = threading.Thread(target=_late, args=(source, self.folder, random.Random(seed)), daemon=True)
            thread.start()
            self._arrived.append(thread)

    def settle(self, engine: sa.Engine, seconds: float) -> None:
        """Wait until the sidecar has done and published what has arrived."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and self.judge(engine).wrong:
            time.sleep(0.5)

    def judge(self, engine: sa.Engine) -> LogsDone:
        """What became of the logs so far."""
        logs = [log for log in done_logs(engine) if log.status != "superseded"]
        return LogsDone(
            len(self._arrived),
            len(logs),
            sum(log.status == "refused" for log in logs),
            sum(not log.complete for log in logs),
            sum(not log.published for log in logs),
        )


def _late(source: Path, folder: Path, chance: random.Random) -> None:
    time.sleep(chance.uniform(0.0, 2.0))
    arrive(source, folder, chance)
