"""What becomes of a visitor's files: waveforms are metered, logs become a dataset, on which the loop is closed.

Everything happens in a hidden folder, which is renamed when all is done: a result is complete, or it is not there. The
files themselves are not kept.
"""

from __future__ import annotations

import asyncio
import re
import shutil
import time
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import orjson

from acqd.errors import UserError
from acqd.extras import LOOP, require
from acqd.robot.description import load_description
from acqd.web.commands import Commands, one_line, password_of, without_password
from acqd.web.dropped import SILENT_S, Dropped
from acqd.web.kept_results import remove_oldest
from acqd.web.recognition import Seen, companions, figures_of, kind_of, logs_have_power, readable_name
from acqd.web.settings import WebSettings
from acqd.web.work_folder import WorkFolder, remove_left

_USUAL_ROBOT = "iiwa7_r800"
_VISITS = 100
_OPTION = re.compile(r"(?<!\S)--[a-z]")
_FOLDERS = re.compile(r"(?<![\w.:/])/(?:[\w.+-]+/)+")


@dataclass(slots=True)
class FilesState:
    """What the page shows."""

    state: Literal["idle", "receiving", "running", "done", "failed", "cancelled"] = "idle"
    step: str = ""
    share: float = 0.0
    begun: float = 0.0
    """Unix s."""
    ended: float | None = None
    error: str = ""
    folder: str = ""
    visit: str = ""
    """Whose files they are, as the visitor's page calls itself."""
    files: list[Seen] = field(default_factory=list)
    pages: list[str] = field(default_factory=list)
    """Of dataset and result, those that exist."""
    removed: int = 0
    """Earlier results that had to go for this one."""


class Files:
    """One visitor's files at a time; the state of the last ones stays until the next."""

    def __init__(self, settings: WebSettings) -> None:
        self._settings, self._section = settings, settings.section
        self._task: asyncio.Task[None] | None = None
        self._arriving: asyncio.Task[str] | None = None
        self._commands = Commands()
        self._dropped: Dropped | None = None
        self._folder: WorkFolder | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._ended: deque[str] = deque(maxlen=_VISITS)
        self.state = FilesState()
        if self._section.files and self._section.reports is not None:
            remove_left(self._section.reports)

    @property
    def running(self) -> bool:
        """Whether the files are being worked through."""
        return self.state.state == "running"

    def as_json(self) -> dict[str, Any]:
        """The state."""
        return asdict(self.state)

    async def take(self, name: str, body: AsyncIterator[bytes], visit: str = "") -> None:
        """Store one file; the first one of a visit begins a new state. Raises UserError."""
        if self.running:
            raise UserError("files are being worked through already; wait, or cancel")
        if self._arriving is not None:
            raise UserError("another file is arriving; try again in a minute")
        if visit in self._ended:
            raise UserError("these files were cancelled; drop all of them again")
        if self.state.state == "receiving" and visit != self.state.visit:
            raise UserError("another visitor is sending files; try again in a minute")
        if self.state.state != "receiving":
            self._begin(visit)
        if self._timer is not None:
            self._timer.cancel()
        assert self._dropped is not None
        self._arriving = arriving = asyncio.create_task(self._dropped.take(name, body))
        try:
            await asyncio.wait({arriving})
        finally:
            arriving.cancel()
            self._arriving = None
            self._timer = asyncio.get_running_loop().call_later(SILENT_S, self._forget)
        if arriving.cancelled() or self.state.state != "receiving":
            raise UserError("these files were cancelled; drop all of them again")
        self.state.files.append(Seen(arriving.result()))

    def _begin(self, visit: str) -> None:
        """Raises UserError."""
        assert self._section.reports is not None
        self._folder = WorkFolder(self._section.reports)
        self._dropped = Dropped(self._folder.path / "in", int(self._section.files_MB * 1e6))
        self.state = FilesState("receiving", begun=time.time(), folder=self._folder.name, visit=visit)

    def _forget(self) -> None:
        """Remove the files of a visitor who has gone."""
        if self.state.state == "receiving":
            self._end("cancelled")

    def start(self, visit: str = "") -> None:
        """Work through the files that are there. Raises UserError."""
        self._require_of(visit)
        if self.state.state != "receiving" or not self.state.files:
            raise UserError("there is no file yet")
        if self._arriving is not None:
            raise UserError("a file is still arriving")
        self.state.state = "running"
        self._task = asyncio.create_task(self._run())

    async def cancel(self, visit: str | None = None) -> None:
        """Forget the files, and end what runs. Raises UserError for files of another visit; None: of any."""
        if visit is not None:
            self._require_of(visit)
        ending = [task for task in (self._task, self._arriving) if task is not None and not task.done()]
        for task in ending:
            task.cancel()
        await asyncio.gather(*ending, return_exceptions=True)
        if self.state.state in ("receiving", "running"):
            self._end("cancelled")

    def _require_of(self, visit: str) -> None:
        """Raises UserError for files of another visit."""
        if self.state.state in ("receiving", "running") and visit != self.state.visit:
            raise UserError("these are files of another visitor")

    async def _run(self) -> None:
        try:
            await self._look()
            await self._close()
            self._end("done")
        except asyncio.CancelledError:
            self._end("cancelled")
            raise
        except Exception as error:  # else the page would show work that never ends
            self._end("failed", self._plain(one_line(error)))

    @property
    def _work(self) -> Path:
        assert self._folder is not None
        return self._folder.path

    def _end(self, state: Literal["done", "failed", "cancelled"], error: str = "") -> None:
        if self._folder is not None:
            if state == "done" and self.state.pages:
                shutil.rmtree(self._work / "in", ignore_errors=True)
                self._folder.keep()
                self.state.removed = self._bound()
            else:
                self._folder.remove()
            self._folder = None
        if self.state.visit:
            self._ended.append(self.state.visit)
        self.state.state, self.state.error, self.state.ended = state, error, time.time()

    def _bound(self) -> int:
        assert self._section.reports is not None
        return len(remove_oldest(self._section.reports, self._section.files_kept, 1e6 * self._section.files_kept_MB))

    async def _look(self) -> None:
        """Say of every file what it is."""
        parts = companions({each.name for each in self.state.files})
        robot = await asyncio.to_thread(load_description, self._section.robot or _USUAL_ROBOT)
        for seen in self.state.files:
            path = self._work / "in" / seen.name
            if seen.name in parts:
                seen.kind, seen.says = "part", "belongs to the other file of this name"
            elif kind := await asyncio.to_thread(kind_of, path, robot):
                seen.kind = kind
                seen.says = "rows of power" if kind == "power" else f"a log of {robot.name}"
            else:
                seen.kind, seen.says = await self._metered(path)

    async def _metered(self, path: Path) -> tuple[Literal["waveform", "unknown"], str]:
        """What the meter says of a waveform, or why a file is none."""
        self._told(f"looking into {path.name}", 0.0)
        out = self._work / "in" / f".{path.name}.rows.jsonl"
        try:
            found = orjson.loads(await self._commands.run(["replay", "--inspect", str(path), "--json"], self._told))
            if found.get("refusal"):
                return (
                    "unknown",
                    f"no log, and no waveform that can be metered as it is: {self._plain(found['refusal'])}",
                )
            self._told(f"metering {path.name}", 0.0)
            await self._commands.run(["replay", str(path), "--out", str(out)], self._told)
        except (UserError, orjson.JSONDecodeError) as error:
            return (
                "unknown",
                f"no log of {self._section.robot or _USUAL_ROBOT}, and no waveform: {self._plain(str(error))}",
            )
        return "waveform", await asyncio.to_thread(figures_of, out, found)

    def _plain(self, text: str) -> str:
        """A message without the folders of this computer, and where options are those of the command line."""
        if self._folder is not None:
            for folder in (self._work / "in", self._work / "logs", self._work):
                text = text.replace(f"{folder}/", "")
        advice = "; the page has no options: use acqd in a terminal" if _OPTION.search(text) else ""
        return _FOLDERS.sub("", text) + advice

    async def _close(self) -> None:
        """A dataset of the logs, and the loop on it where the page has a model. Raises UserError."""
        logs = [each.name for each in self.state.files if each.kind == "log"]
        if not logs:
            if not any(each.kind in ("waveform", "power") for each in self.state.files):
                raise UserError("none of these files is a waveform, rows of power or a log of the robot; see the list")
            return
        require("a dataset", LOOP, "loop")
        folder = self._work / "logs"
        folder.mkdir()
        for name in logs:
            (self._work / "in" / name).rename(folder / readable_name(name))
        try:
            await self._build(folder)
            if self._section.model is not None:
                await self._loop()
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    async def _build(self, logs: Path) -> None:
        self._told("dataset", 0.0)
        rows = [each.name for each in self.state.files if each.kind == "power"]
        if len(rows) > 1:
            raise UserError(f"{' and '.join(rows)} both have rows of power: drop one of them beside the logs")
        power = str(self._work / "in" / rows[0]) if rows else self._usual_power(logs)
        robot = ["--robot", self._section.robot] if self._section.robot else []
        await self._commands.run(
            ["dataset", "build", "--power", power, "--logs", str(logs), "--out", str(self._work / "dataset"), *robot],
            lambda step, share: self._told(f"dataset: {step}", share),
            {} if rows else password_of(self._settings.database),
        )  # fmt: skip
        self.state.pages.append("dataset")

    def _usual_power(self, logs: Path) -> str:
        """Where the power of logs is that came alone: in the database of the page, or in the logs."""
        database = self._settings.database
        there = "://" in database or Path(database).exists()
        return without_password(database) if there and not logs_have_power(logs) else "log"

    async def _loop(self) -> None:
        self._told("search", 0.0)
        out, model = str(self._work / "result"), str(self._section.model)
        await self._commands.run(
            ["close-loop", str(self._work / "dataset"), "--model", model, "--out", out],
            lambda step, share: self._told(f"search: {step}", share),
        )
        self.state.pages.append("result")

    def _told(self, step: str, share: float) -> None:
        self.state.step, self.state.share = step, share
