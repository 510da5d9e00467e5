"""What acqd has made in a folder: datasets, models, closing reports, designed motions. Their JSON files are read."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

from acqd.discrepancy.settled import leaves_open
from acqd.errors import UserError, no_folder
from acqd.report.joint_names import all_with_joint_names

_DEPTH = 4
"""Folders below the one that was named; results lie beside their datasets."""


@dataclass(frozen=True, slots=True)
class Data:
    """A dataset."""

    path: Path
    robot: str
    description: str
    """Of the robot, as --robot takes it: a shipped name, or the path of a file."""
    measured: str
    recordings: int
    seconds: float
    start_ns: int
    content: bytes
    """Equal for copies only: simulated sessions all begin at the same time."""


@dataclass(frozen=True, slots=True)
class Model:
    """A trained model."""

    path: Path
    name: str
    robot: str
    dataset: str
    """Folder of the dataset that the model was trained on, as `acqd train` was told."""
    repaired: bool
    """Whether the model is the result of a closing report."""
    sliding: bool
    """Whether an axis is prismatic: an FMU has revolute joints only."""


@dataclass(frozen=True, slots=True)
class Loop:
    """A closing report."""

    path: Path
    dataset: str
    """Folder of the recordings in question, as the loop was told."""
    further: tuple[str, ...]
    """Datasets of later sessions."""
    model: str
    verdict: str
    names: tuple[str, ...]
    causes: str
    """The set of causes in words; "" where there is none."""
    open: bool
    """Whether the report leaves a question."""
    designable: bool
    """Whether `acqd next` can design a motion that decides; reports of earlier versions do not say."""
    advice: str
    """What the report itself says to do next; "" where it says nothing."""
    added: bool
    """Whether the repaired model differs from the model."""
    smallest: int
    """Effects whose smallest size is known."""


@dataclass(frozen=True, slots=True)
class Program:
    """A motion that decides."""

    path: Path
    report: str
    minutes: float
    worked_min: float
    """Work before the recording."""


@dataclass(slots=True)
class Found:
    """What lies in a folder, each kind in the order of time."""

    folder: Path
    datasets: list[Data] = field(default_factory=list)
    models: list[Model] = field(default_factory=list)
    loops: list[Loop] = field(default_factory=list)
    programs: list[Program] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    """Files with a known name and a content of another kind."""


def found_in(folder: Path) -> Found:
    """Look through a folder. Raises UserError where there is no folder that can be read."""
    if not folder.is_dir():
        raise UserError(f"{folder}: {no_folder(folder)}; name the one with your datasets, or leave the name out")
    found = Found(folder)
    readers: dict[str, Callable[[Path, dict[str, Any]], None]] = {
        "manifest.json": lambda path, content: found.datasets.append(_dataset(path, content)),
        "bundle.json": lambda path, content: found.models.append(_model(path, content)),
        "report.json": lambda path, content: found.loops.append(_loop(path, content)),
        "next.json": lambda path, content: found.programs.append(_program(path, content)),
    }
    read: list[tuple[int, Path, Any]] = []
    for path in sorted(_files(folder, set(readers))):
        try:
            read.append((path.stat().st_mtime_ns, path, orjson.loads(path.read_bytes())))
        except (OSError, ValueError):
            found.unread.append(str(path))
    for _, path, content in sorted(read, key=lambda each: each[0]):
        try:
            readers[path.name](path.parent, content)
        except (ValueError, KeyError, TypeError, AttributeError):
            found.unread.append(str(path))
    found.datasets.sort(key=lambda each: each.start_ns)
    return found


def _files(folder: Path, names: set[str]) -> Iterator[Path]:
    def refuse(error: OSError) -> None:
        if Path(error.filename) == folder:
            raise UserError(f"{folder}: cannot be read ({error.strerror})")

    for parent, folders, files in os.walk(folder, onerror=refuse):
        here = Path(parent)
        deep = len(here.relative_to(folder).parts) >= _DEPTH
        folders[:] = [] if deep else [each for each in folders if not each.startswith(".")]
        yield from (here / name for name in files if name in names)


def _dataset(path: Path, manifest: dict[str, Any]) -> Data:
    recordings = manifest["recordings"]
    seconds = sum(float(each["valid_s"]) for each in recordings)
    return Data(
        path, str(manifest["robot"]), str(manifest.get("description", manifest["robot"])), str(manifest["measured"]),
        len(recordings), seconds,
        int(manifest["power"]["first_ns"]), orjson.dumps([manifest["power"], recordings]),
    )  # fmt: skip


def _model(path: Path, bundle: dict[str, Any]) -> Model:
    trained_on = bundle["provenance"].get("dataset", "")
    return Model(
        path,
        str(bundle["name"]),
        str(bundle["robot"]),
        str(trained_on),
        (path.parent / "report.json").exists(),
        any(each["unit"] == "m" for each in bundle.get("inputs", [])),
    )


def _loop(path: Path, report: dict[str, Any]) -> Loop:
    report = all_with_joint_names(report, report.get("joint_names", ()))
    effects, causes, asked = report["effects"], report.get("causes"), report["asked"]
    told = {each["id"] for each in report["ability"]["effects"] if each["smallest"]}
    return Loop(
        path, str(asked["dataset"]), tuple(map(str, asked["with"])), str(asked["model"]), str(report["verdict"]),
        tuple(f"{e['id']} ({e['where']})" for e in effects),
        causes["text"] if causes else "", leaves_open(report), bool(report.get("designable", True)),
        str(next(iter(report.get("next", [])), "")),
        any(each["added"] for each in effects) or bool(report["correction"]), len(told),
    )  # fmt: skip


def _program(path: Path, content: dict[str, Any]) -> Program:
    return Program(path, str(content["report"]), float(content["seconds"]) / 60, float(content.get("worked_min", 0.0)))
