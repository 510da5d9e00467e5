"""What becomes of a visitor's files: waveforms are metered, logs become a dataset, on which the loop is closed.

Everything happens in a hidden folder, which is renamed when all is done: a result is complete, or it is not there. The
files themselves are not kept.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import re
import shutil
import time
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import orjson

from acqd.errors import InputError, UserError
from acqd.extras import LOOP, require
from acqd.robot.bag import is_bag
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log_layout import layout_of
from acqd.robot.table import Table, text_of
from acqd.robot.table_text import joined, text_tables
from acqd.web.commands import Commands, one_line, password_of, without_password
from acqd.web.dropped import SILENT_S, Dropped
from acqd.web.settings import WebSettings
from acqd.web.work_folder import WorkFolder, remove_left

_HEAD_BYTES = 1 << 16
_USUAL_ROBOT = "iiwa7_r800"
_ROWS = {".jsonl", ".ndjson", ".sqlite", ".sqlite3", ".db"}
_TEXT = {".csv", ".log", ".txt"}
"""Of logs; with another suffix `acqd dataset build` passes a log over."""
_POWER_IN_LOGS = {"power", "actual_robot_voltage", "P"}
_VISITS = 100
_OPTION = re.compile(r"(?<!\S)--[a-z]")
_FOLDERS = re.compile(r"(?<![\w.:/])/(?:[\w.+-]+/)+")
_COMPANIONS = {".cfg": ".dat"}
"""Files that belong to another of the same name."""


@dataclass(slots=True)
class Seen:
    """A file and what was seen in it."""

    name: str
    kind: Literal["", "waveform", "power", "log", "part", "unknown"] = ""
    says: str = ""


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
            else:
                self._folder.remove()
            self._folder = None
        if self.state.visit:
            self._ended.append(self.state.visit)
        self.state.state, self.state.error, self.state.ended = state, error, time.time()

    async def _look(self) -> None:
        """Say of every file what it is."""
        names = {each.name for each in self.state.files}
        parts = {
            f"{Path(name).stem}{part}" for name in names for whole, part in _COMPANIONS.items() if name.endswith(whole)
        }
        robot = await asyncio.to_thread(load_description, self._section.robot or _USUAL_ROBOT)
        for seen in self.state.files:
            path = self._work / "in" / seen.name
            if seen.name in parts:
                seen.kind, seen.says = "part", "belongs to the other file of this name"
            elif kind := await asyncio.to_thread(_plain_kind, path, robot):
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
        return "waveform", await asyncio.to_thread(_figures, out, found)

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
            (self._work / "in" / name).rename(folder / _readable(name))
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
        return without_password(database) if there and not _logs_have_power(logs) else "log"

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


def _readable(name: str) -> str:
    """A name by which a log is read."""
    path = Path(name)
    return name if path.suffix in (*_TEXT, ".parquet") or is_bag(path) else f"{name}.csv"


def _beginning(path: Path) -> Table:
    """The first rows of a table, of Parquet the names of the columns. Raises UserError, OSError, ValueError."""
    if path.suffix == ".parquet":
        require("Parquet", ("pyarrow",), "data")
        import pyarrow.parquet

        names = pyarrow.parquet.read_schema(path).names
        return Table(names, np.empty((0, len(names))), np.empty(0, np.int64))
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    whole = len(head) < _HEAD_BYTES
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        head = head.decode("utf-16", errors="ignore").encode()
    if b"\0" in head:
        raise InputError(path, "is no text")
    head = head if whole else head.rpartition(b"\n")[0]
    return joined(list(text_tables(path, text_of(path, io.BytesIO(head)))))


def _plain_kind(path: Path, robot: RobotDescription) -> Literal["power", "log", ""]:
    """A log by its columns, power by its ending or as another table with P and time; "" for another file."""
    if path.suffix in _ROWS:
        return "power"
    if is_bag(path):
        return "log"
    with contextlib.suppress(UserError, OSError, ValueError):
        table = _beginning(path)
        if layout_of(table, robot):
            return "log"
        names = set(table.header or ())
        return "power" if "P" in names and {"time", "filetime"} & names else ""
    return ""


def _logs_have_power(logs: Path) -> bool:
    """Whether the logs have columns of power themselves."""
    with contextlib.suppress(UserError, OSError, ValueError):
        return all(not is_bag(path) and _POWER_IN_LOGS & set(_beginning(path).header or ()) for path in logs.iterdir())
    return False


def _figures(rows: Path, found: dict[str, Any]) -> str:
    """Mean power and energy of metered rows: of the total, else of L1."""
    powers: dict[str, list[float]] = {"total": [], "L1": []}
    energies: dict[str, float] = {}
    with rows.open("rb") as lines:
        for line in lines:
            row = orjson.loads(line)
            if row["channel"] in powers and row["P"] is not None:
                powers[row["channel"]].append(row["P"])
                energies[row["channel"]] = row["W"] or 0.0
    seconds = found["samples"] / found["rate"] if found.get("rate") else 0.0
    channel = "total" if powers["total"] else "L1"
    chosen = powers[channel]
    if not chosen:
        return f"{seconds:.3g} s: no window of 40 ms is complete"
    return f"{seconds:.3g} s metered: mean power {np.mean(chosen):.5g} W, {1000 * energies[channel]:.4g} Wh"
