"""The dataset of one robot, brought up to date: only logs that it does not hold are read."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

from acqd.atomic import write_complete
from acqd.dataset.build import build
from acqd.dataset.config import BuildConfig
from acqd.dataset.manifest import load_manifest
from acqd.errors import UserError
from acqd.fleet.robot import FleetRobot, power_stamp

_STATE = "dataset.json"


@dataclass(frozen=True, slots=True)
class UpToDate:
    """A dataset, and the logs that are not in it."""

    path: Path
    refused: list[str] = field(default_factory=list)
    """One line per log."""


def up_to_date(robot: FleetRobot, folder: Path, description: str, step_s: float) -> UpToDate:
    """Build, extend or leave the dataset in `folder`. Raises UserError, InputError, OperationError.

    A log that was refused is tried again when the power rows have changed: they may have been late.
    """
    if robot.dataset is not None:
        return UpToDate(robot.dataset)
    assert robot.power is not None and robot.logs is not None
    out, state = folder / "dataset", _state(folder)
    if state.get("settings") != robot.settings_digest():
        shutil.rmtree(out, ignore_errors=True)
    logs, stamp = robot.log_hashes(), power_stamp(robot.power)
    held = _held(out)
    refused = dict(state.get("refused", {})) if held and stamp is not None and state.get("power") == stamp else {}
    if not held or logs.keys() - held - refused.keys():
        refused = _build(robot, out, description, step_s, append=bool(held))
    kept = {"settings": robot.settings_digest(), "power": stamp, "refused": refused}
    folder.mkdir(parents=True, exist_ok=True)
    write_complete(folder / _STATE, orjson.dumps(kept, option=orjson.OPT_INDENT_2))
    return UpToDate(out, list(refused.values()))


def _build(robot: FleetRobot, out: Path, description: str, step_s: float, *, append: bool) -> dict[str, str]:
    """Reasons by the hashes of the logs that are not in the dataset afterwards."""
    assert robot.power is not None and robot.logs is not None
    config = BuildConfig(
        robot.power, robot.logs, out, description, robot.device, robot.channel, robot.torque, robot.search_s, step_s,
        lag_s=robot.lag_s, cut_s=robot.cut_s, append=append,
    )  # fmt: skip
    reasons: list[str] = []
    try:
        reasons = build(config, lambda *_: None).refused
    except UserError:
        if not append:
            raise
        # none of the new logs can be used: the dataset is as it was
    held = _held(out)
    lost = {content: path for content, path in robot.log_hashes().items() if content not in held}
    return {
        content: next((line for line in reasons if line.startswith(f"{path}:")), f"{path}: cannot be used")
        for content, path in lost.items()
    }


def _held(out: Path) -> set[str]:
    """Hashes of the logs that a dataset holds."""
    if not (out / "manifest.json").exists():
        return set()
    return {entry["log"]["sha256"] for entry in load_manifest(out)["recordings"]}


def _state(folder: Path) -> dict[str, Any]:
    try:
        state = orjson.loads((folder / _STATE).read_bytes())
    except (OSError, orjson.JSONDecodeError):
        return {}
    return state if isinstance(state, dict) else {}
