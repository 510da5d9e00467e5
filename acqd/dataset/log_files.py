"""Finds the logs of one build and reads them; what is wrong with one log does not stop the others."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from acqd.dataset.copied_logs import DistinctLogs
from acqd.dataset.log_check import check_log
from acqd.dataset.motion_notes import motion_notes
from acqd.errors import InputError, UserError
from acqd.robot.bag import SUFFIXES as BAGS
from acqd.robot.bag import is_bag
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import read_log

_SUFFIXES = (".log", ".csv", ".txt", ".parquet", *BAGS)
_PACKED = (".gz", ".bz2", ".xz", ".zst", ".lz4", ".zip", ".7z", ".tar", ".tgz")
_Value = TypeVar("_Value")


@dataclass(slots=True)
class Logs:
    """Logs that can be used, and what is to be said of the others."""

    kept: list[RobotLog] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    """One line for each log that cannot be used."""
    notes: list[str] = field(default_factory=list)
    known: int = 0
    """Logs whose content is in the dataset already."""

    def keep(self, function: Callable[[RobotLog], _Value], progress: Callable[[float], None]) -> list[_Value]:
        """Results of `function` for the logs; a log for which it raises InputError is refused.

        Raises UserError when no log is left.
        """
        kept, values = [], []
        for number, log in enumerate(self.kept):
            try:
                values.append(function(log))
                kept.append(log)
            except InputError as error:
                self.refused.append(str(error))
            progress((number + 1) / len(self.kept))
        self.kept = kept
        self.require_any()
        return values

    def require_any(self) -> None:
        """Raises UserError when no log is left: with the reason of the first one."""
        if not self.kept:
            several = f"none of {len(self.refused)} logs can be used; the first: " if len(self.refused) > 1 else ""
            raise UserError(f"{several}{self.refused[0]}")


def read_logs(
    folder: Path,
    robot: RobotDescription,
    present: dict[str, str],
    names: Iterable[str],
    progress: Callable[[float], None],
) -> Logs:
    """Reads all logs in a folder, or one log.

    `present`: recordings of an existing dataset by the hash of their log's content; such logs are not read again.
    `names`: names that are taken. Raises UserError when no log is left.
    """
    logs, seen, taken, distinct = Logs(), dict(present), set(names), DistinctLogs()
    paths = log_files(folder)
    for number, path in enumerate(paths):
        content = content_hash(path)
        if content in present:
            logs.known += 1
        else:
            try:
                log = _read(path, robot, seen.get(content), taken)
                distinct.add(log)
                logs.kept.append(log)
                seen[content] = path.name
            except InputError as error:
                logs.refused.append(str(error))
        progress((number + 1) / len(paths))
    if logs.known and not logs.kept:
        others = f"; {len(logs.refused)} cannot be used, the first: {logs.refused[0]}" if logs.refused else ""
        raise UserError(f"{folder}: nothing new, {logs.known} of its logs are in the dataset by content{others}")
    logs.require_any()
    logs.notes += [f"{log.path}: {log.note}" for log in logs.kept if log.note]
    logs.notes += motion_notes(logs.kept)
    return logs


def uncommon_columns(logs: list[RobotLog]) -> list[str]:
    """Notes on quantities that some logs lack and others have: a model uses what all logs have."""
    has = {
        "torques": [log.tau is not None for log in logs],
        "currents": [log.current is not None for log in logs],
        "temperatures": [log.temperature is not None for log in logs],
        **{name: [name in log.signals for log in logs] for name in ("brake", "tool")},
    }
    return [
        f"{known.count(False)} of {len(logs)} logs have no {name}, or not of all joints, the first: "
        f"{logs[known.index(False)].path}; a model uses what all its logs have"
        for name, known in has.items()
        if any(known) and not all(known)
    ]


def _read(path: Path, robot: RobotDescription, twin: str | None, taken: set[str]) -> RobotLog:
    if twin is not None:
        raise InputError(path, f"has the same content as {twin}")
    if path.stem in taken:
        raise InputError(path, f"the dataset has another recording named {path.stem}; rename this log")
    log = read_log(path, robot)
    check_log(log, robot)
    return log


def log_files(folder: Path) -> list[Path]:
    """Paths of all logs below a folder, sorted; a bag is one log. Raises UserError."""
    if folder.is_file() or is_bag(folder):
        return [folder]
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder or log")
    found = sorted(path for path in folder.rglob("*") if path.suffix in _SUFFIXES and path.is_file())
    bags = sorted(path.parent for path in folder.rglob("metadata.yaml"))
    paths = sorted([path for path in found if not any(bag in path.parents for bag in bags)] + bags)
    if not paths:
        packed = next((path for path in sorted(folder.rglob("*")) if path.suffix in _PACKED and path.is_file()), None)
        hint = f"; {packed.name} is compressed: unpack it first" if packed else ""
        raise UserError(f"{folder}: no robot logs ({', '.join(_SUFFIXES)}) there{hint}")
    by_name: dict[str, list[Path]] = {}
    for path in paths:
        by_name.setdefault(path.stem, []).append(path)
    if repeated := next((same for same in by_name.values() if len(same) > 1), None):
        one, other = (path.relative_to(folder) for path in repeated[:2])
        raise UserError(
            f"{folder}: two logs are named {one.stem}: {one} and {other}; recordings are named after their logs: "
            "rename one, or build one dataset per robot"
        )
    return paths


def content_hash(path: Path) -> str:
    """SHA-256 of a log's content: of the file, or of the files of a bag."""
    if path.is_file():
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    parts = (content_hash(part).encode() for part in sorted(path.iterdir()) if part.is_file())
    return hashlib.sha256(b"".join(parts)).hexdigest()
