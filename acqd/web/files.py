"""What becomes of a visitor's files: waveforms are metered, logs become a dataset, on which the loop is closed.

Everything happens in a hidden folder, which is renamed when all is done: a result is complete, or it is not there. The
files themselves are not kept.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import shutil
import time
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import orjson

from acqd.errors import UserError
from acqd.extras import LOOP, require
from acqd.robot.bag import is_bag
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log_layout import layout_of
from acqd.robot.table_text import joined, text_tables
from acqd.web.commands import Commands, password_of, without_password
from acqd.web.dropped import Dropped
from acqd.web.settings import WebSettings

_HEAD_BYTES = 1 << 16
_USUAL_ROBOT = "iiwa7_r800"
_ROWS = {".jsonl", ".ndjson", ".sqlite", ".db"}
_POWER_IN_LOGS = {"power", "actual_robot_voltage", "P"}
_SILENT_S = 60.0
"""A visitor who sends nothing for so long has gone."""
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
    files: list[Seen] = field(default_factory=list)
    pages: list[str] = field(default_factory=list)
    """Of dataset and result, those that exist."""


class Files:
    """One visitor's files at a time; the state of the last ones stays until the next."""

    def __init__(self, settings: WebSettings) -> None:
        self._settings, self._section = settings, settings.section
        self._task: asyncio.Task[None] | None = None
        self._commands = Commands()
        self._dropped: Dropped | None = None
        self._visit, self._heard = "", 0.0
        self.state = FilesState()
        if self._section.files and self._section.reports is not None:
            for left in self._section.reports.glob(".files-*"):  # of a page that was killed
                shutil.rmtree(left, ignore_errors=True)

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
        if self.state.state == "receiving" and visit != self._visit:
            if time.monotonic() - self._heard < _SILENT_S:
                raise UserError("another visitor is sending files; try again in a minute")
            self._end("cancelled")
        self._visit, self._heard = visit, time.monotonic()
        if self.state.state != "receiving":
            assert self._section.reports is not None
            now = time.time()
            stem = time.strftime("files-%Y%m%dT%H%M%SZ", time.gmtime(now))
            work = self._section.reports / f".{stem}"
            self._dropped = Dropped(work / "in", int(self._section.files_MB * 1e6))
            self.state = FilesState("receiving", begun=now, folder=stem)
        assert self._dropped is not None
        stored = await self._dropped.take(name, body)
        self._heard = time.monotonic()
        self.state.files.append(Seen(stored))

    def start(self) -> None:
        """Work through the files that are there. Raises UserError."""
        if self.state.state != "receiving" or not self.state.files:
            raise UserError("there is no file yet")
        self.state.state = "running"
        self._task = asyncio.create_task(self._run())

    async def cancel(self) -> None:
        """Forget the files, and end what runs."""
        if self._task is not None and not self._task.done():
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        elif self.state.state == "receiving":
            self._end("cancelled")

    async def _run(self) -> None:
        try:
            await self._look()
            await self._close()
            self._end("done")
        except asyncio.CancelledError:
            await self._commands.end()
            self._end("cancelled")
            raise
        except (UserError, OSError) as error:
            self._end("failed", self._plain(error))

    @property
    def _work(self) -> Path:
        assert self._section.reports is not None
        return self._section.reports / f".{self.state.folder}"

    def _end(self, state: Literal["done", "failed", "cancelled"], error: str = "") -> None:
        work, place = self._work, self._work.with_name(self.state.folder)
        if state == "done" and self.state.pages:
            shutil.rmtree(work / "in", ignore_errors=True)
            work.rename(place)
        else:
            shutil.rmtree(work, ignore_errors=True)
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
                return "unknown", f"no log, and no waveform that can be metered as it is: {found['refusal']}"
            self._told(f"metering {path.name}", 0.0)
            await self._commands.run(["replay", str(path), "--out", str(out)], self._told)
        except (UserError, orjson.JSONDecodeError) as error:
            return "unknown", f"no log of {self._section.robot or _USUAL_ROBOT}, and no waveform: {self._plain(error)}"
        return "waveform", await asyncio.to_thread(_figures, out, found)

    def _plain(self, error: Exception) -> str:
        """A message without the folders of this computer."""
        return (
            str(error).replace(f"{self._work}/in/", "").replace(f"{self._work}/logs/", "").replace(f"{self._work}/", "")
        )

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
            (self._work / "in" / name).rename(folder / name)
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


def _begin_of(path: Path) -> bytes:
    """The first whole lines."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
        return head if len(head) < _HEAD_BYTES else head.rpartition(b"\n")[0]
    return b""


def _columns(path: Path) -> set[str]:
    """Names in the first line of a table."""
    line = _begin_of(path).decode("utf-8-sig", errors="replace").partition("\n")[0]
    for sign in ("\t", ";"):
        line = line.replace(sign, ",")
    return {name.strip().strip('"') for name in line.split(",")}


def _plain_kind(path: Path, robot: RobotDescription) -> Literal["power", "log", ""]:
    """Power by its ending or as a table with P and time and no angles, a log by its columns; "" for another file."""
    if path.suffix in _ROWS:
        return "power"
    if is_bag(path):
        return "log"
    names = _columns(path)
    if "P" in names and {"time", "filetime"} & names and "q1" not in names:
        return "power"
    begin = _begin_of(path)
    if b"\0" in begin:
        return ""
    try:
        return "log" if layout_of(joined(list(text_tables(path, io.BytesIO(begin)))), robot) else ""
    except (UserError, ValueError):
        return ""


def _logs_have_power(logs: Path) -> bool:
    """Whether the logs have columns of power themselves."""
    return all(_columns(path) & _POWER_IN_LOGS for path in logs.iterdir())


def _figures(rows: Path, found: dict[str, Any]) -> str:
    """Mean power and energy of metered rows."""
    powers, energy, seconds = [], 0.0, found["samples"] / found["rate"] if found.get("rate") else 0.0
    with rows.open("rb") as lines:
        for line in lines:
            row = orjson.loads(line)
            if row["channel"] in ("total", "L1") and row["P"] is not None:
                powers.append((row["channel"], row["P"]))
                energy = max(energy, abs(row["W"] or 0.0))
    chosen = [P for channel, P in powers if channel == "total"] or [P for _, P in powers]
    if not chosen:
        return f"{seconds:.3g} s: no window of 40 ms is complete"
    return f"{seconds:.3g} s metered: mean power {sum(chosen) / len(chosen):.5g} W, {1000 * energy:.4g} Wh"
