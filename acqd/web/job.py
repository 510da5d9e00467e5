"""The loop on the recordings since an alarm, as a background job: one at a time, cancelled cleanly.

The work is done by `acqd dataset build` and `acqd close-loop` in separate processes, at low priority. A job writes
below its folder and touches no model.
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import sqlalchemy as sa

from acqd.errors import UserError
from acqd.extras import LOOP, require
from acqd.timestamps import rfc3339_ms
from acqd.web.commands import Commands, one_line, password_of, without_password
from acqd.web.predictions import logs_since
from acqd.web.settings import WebSettings


@dataclass(frozen=True, slots=True)
class JobState:
    """What the page shows of the newest job."""

    state: Literal["idle", "running", "done", "failed", "cancelled"] = "idle"
    part: int = 1
    """1: the dataset; 2: the search."""
    step: str = ""
    share: float = 0.0
    """Of this step."""
    begun: float = 0.0
    """Unix s."""
    since: float = 0.0
    """Onset of the alarm [Unix s]."""
    recordings: int = 0
    folder: str = ""
    """Name of the job's folder below [web] reports."""
    error: str = ""
    ended: float | None = field(default=None)


class LoopJob:
    """At most one job; the state of the last one stays until the next."""

    def __init__(self, settings: WebSettings) -> None:
        self._settings, self._section = settings, settings.section
        self._task: asyncio.Task[None] | None = None
        self._commands = Commands()
        self.state = JobState()

    def start(self, engine: sa.Engine, device: str, since_s: float) -> None:
        """Begin a job on the logs that end after `since_s` (Unix s). Raises UserError; reads the database."""
        if self.running:
            raise UserError("a search is running already; wait for it, or cancel it")
        require("the search", LOOP, "loop")
        assert self._section.reports is not None and self._section.logs is not None
        names = logs_since(engine, rfc3339_ms(since_s))
        found = [path for name in names if (path := _below(self._section.logs, name)) is not None]
        if not found:
            raise UserError(
                f"{self._section.logs}: no log that the sidecar has compared ends after {rfc3339_ms(since_s)}"
            )
        now = time.time()
        folder = self._section.reports / time.strftime("loop-%Y%m%dT%H%M%SZ", time.gmtime(now))
        _link_all(folder / "logs", found, self._section.logs)
        self.state = JobState("running", 1, "starting", 0.0, now, since_s, len(found), folder.name)
        self._device = device

    @property
    def running(self) -> bool:
        """Whether a search runs."""
        return self.state.state == "running"

    def run(self) -> None:
        """Do what `start` has prepared, unless it was cancelled meanwhile; in the event loop."""
        if not self.running:
            return
        self._task = asyncio.create_task(self._run())

    async def cancel(self) -> None:
        """End the job and its process; does nothing when none runs."""
        if self._task is not None and not self._task.done():
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        if self.running:  # a job that had not begun
            self._end("cancelled")

    def as_json(self) -> dict[str, Any]:
        """The state."""
        return asdict(self.state)

    async def _run(self) -> None:
        folder = self._folder()
        try:
            await self._command(self._build(folder), 1)
            await self._command(self._close(folder), 2)
            self._end("done")
        except asyncio.CancelledError:
            self._end("cancelled")
            raise
        except Exception as error:  # else the page would show a search that never ends
            self._end("failed", one_line(error))

    def _folder(self) -> Path:
        assert self._section.reports is not None
        return self._section.reports / self.state.folder

    def _end(self, state: Literal["done", "failed", "cancelled"], error: str = "") -> None:
        self.state = replace(self.state, state=state, error=error, ended=time.time())

    def _build(self, folder: Path) -> list[str]:
        robot = ["--robot", self._section.robot] if self._section.robot else []
        power = without_password(self._settings.database)
        device = ["--device", self._device] if self._device else []
        return [
            *("dataset", "build", "--power", power, "--logs", str(folder / "logs"), "--out", str(folder / "dataset")),
            *(*robot, *device, "--json"),
        ]

    def _close(self, folder: Path) -> list[str]:
        out = folder / "result"
        model = str(self._section.model)
        return ["close-loop", str(folder / "dataset"), "--model", model, "--out", str(out), "--json"]

    async def _command(self, arguments: list[str], part: int) -> None:
        """Run one command of acqd. Raises UserError with its last line when it fails."""
        self.state = replace(self.state, part=part, step="starting", share=0.0)
        await self._commands.run(arguments, self._told, password_of(self._settings.database))

    def _told(self, step: str, share: float) -> None:
        self.state = replace(self.state, step=step, share=share)


def _below(folder: Path, name: str) -> Path | None:
    """A log of this name; None when it is gone, or not below the folder."""
    path = (folder / name).resolve()
    return path if path.is_file() and path.is_relative_to(folder.resolve()) else None


def _link_all(folder: Path, logs: list[Path], base: Path) -> None:
    """Links to the logs. Raises UserError when they cannot be made."""
    try:
        folder.mkdir(parents=True)
        for path in logs:
            (folder / "-".join(path.relative_to(base.resolve()).parts)).symlink_to(path)
    except OSError as error:
        raise UserError(f"{folder} cannot be written ({error.strerror}); see [web] reports") from None
