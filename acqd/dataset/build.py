"""`acqd dataset build`: logs and power rows in, aligned recordings with provenance out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import orjson
import pyarrow.parquet

from acqd import __version__
from acqd.atomic import complete_folder
from acqd.dataset.column_check import check_columns
from acqd.dataset.cut import cut
from acqd.dataset.merge import Recording, merge
from acqd.dataset.pictures import write_report
from acqd.dataset.placement import Alignment, Located, given, locate
from acqd.dataset.power import Measured, PowerStream, open_power
from acqd.dataset.regressors import Explanation, TorqueSource, explain
from acqd.dataset.split import kinds_of, sources_of, split
from acqd.errors import InputError, UserError
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log import RobotLog, read_log

_SUFFIXES = (".log", ".csv", ".txt")
_LEAST_VALID_S = 2.0
_MANY = 4  # logs that ought to show a common clock


_Merged: TypeAlias = tuple[RobotLog, Located, Recording | None, str]
"""A log, where it lies, what came of it, and if nothing did, why."""


@dataclass(frozen=True, slots=True)
class BuildConfig:
    """What to merge, and how."""

    power: str
    logs: Path
    out: Path
    robot: str
    device: str | None = None
    channel: str | None = None
    torque: TorqueSource | None = None
    search_s: float = 2.4
    step_s: float = 0.04
    seed: int = 1
    lag_s: float | None = None
    """Of all logs, when it is known: nothing is searched for."""
    cut_s: float | None = None
    """Logs are cut into pieces of so many seconds, each a source of its own."""


@dataclass(slots=True)
class BuildReport:
    """What came of it."""

    out: str
    robot: str
    recordings: int = 0
    seconds: float = 0.0
    refused: list[str] = field(default_factory=list)
    """Logs that could not be placed, and why."""
    notes: list[str] = field(default_factory=list)
    offset_s: float | None = None
    drift_ppm: float | None = None
    scatter_ms: float | None = None
    supply_lag_ms: float = 0.0
    split: dict[str, int] = field(default_factory=dict)
    measured: Measured = "mains"


def build(order: BuildConfig, progress: Callable[[str, float], None]) -> BuildReport:
    """Align, merge and write; nothing appears under `out` unless all of it does. Raises UserError."""
    if order.out.exists():
        raise UserError(f"{order.out} exists; choose another --out, or remove it")
    robot = load_description(order.robot)
    paths = _log_files(order.logs)
    progress("reading power", 0.0)
    power = open_power(order.power, order.device, order.channel)
    logs = []
    for number, path in enumerate(paths):
        logs.append(read_log(path, robot))
        progress("reading logs", (number + 1) / len(paths))
    if order.cut_s is not None:
        logs = [piece for log in logs for piece in cut(log, order.cut_s)]
    explained: list[Explanation] = []
    early: list[str] = []
    if order.lag_s is not None:
        alignment = given(len(logs), order.lag_s)
    else:
        logs, explained = _explained(logs, robot, order.torque, early, progress)
        check_columns(logs, robot)
        alignment = locate(explained, power, order.search_s, lambda share: progress("aligning", share))
    if all(located.method == "refused" for located in alignment.located):
        raise UserError(
            f"none of {len(logs)} logs can be placed in the power stream (best R2 "
            f"{max(located.own.r2 for located in alignment.located):.2f}): is it this robot's power, of these days?"
        )
    merged = _merge_all(order, logs, power, alignment)
    pictures = _report(order, robot, power, alignment, merged, explained)
    report = _write(order, robot, power, alignment, merged, early, pictures)
    if alignment.line is None and order.lag_s is None and len(logs) >= _MANY:
        report.notes.append("the logs' lags lie on no common clock: were columns mixed up, or clocks set?")
    return report


def _explained(
    logs: list[RobotLog],
    robot: RobotDescription,
    torque: TorqueSource | None,
    refused: list[str],
    progress: Callable[[str, float], None],
) -> tuple[list[RobotLog], list[Explanation]]:
    """What can be explained; the rest is told in `refused`. Raises InputError when nothing can."""
    kept, explained = [], []
    for number, log in enumerate(logs):
        try:
            explained.append(explain(log, robot, torque))
            kept.append(log)
        except InputError as error:
            if number == len(logs) - 1 and not kept:
                raise
            refused.append(str(error))
        progress("computing what a meter must see", (number + 1) / len(logs))
    return kept, explained


def _log_files(folder: Path) -> list[Path]:
    if folder.is_file():
        return [folder]
    paths = sorted(path for path in folder.rglob("*") if path.suffix in _SUFFIXES and path.is_file())
    if not paths:
        raise UserError(f"{folder}: no robot logs ({', '.join(_SUFFIXES)}) there")
    stems = [path.stem for path in paths]
    doubled = {stem for stem in stems if stems.count(stem) > 1}
    if doubled:
        raise UserError(f"{folder}: several logs named {min(doubled)}; build one dataset per robot")
    return paths


def _merge_all(order: BuildConfig, logs: list[RobotLog], power: PowerStream, alignment: Alignment) -> list[_Merged]:
    drift = alignment.line.drift_ppm if alignment.line else 0.0
    results: list[_Merged] = []
    for log, located in zip(logs, alignment.located, strict=True):
        if located.method == "refused":
            results.append((log, located, None, located.note))
            continue
        recording = merge(log.path.stem, log, power, located.lag_s, drift, order.step_s)
        if recording.valid.sum() * order.step_s < _LEAST_VALID_S:
            results.append((log, located, None, "no power rows in its time span"))
        else:
            results.append((log, located, recording, ""))
    if all(recording is None for _, _, recording, _ in results):
        raise UserError(
            "no log overlaps the power stream: are they of the same days? --search SECONDS widens the search"
        )
    return results


def _write(
    order: BuildConfig,
    robot: RobotDescription,
    power: PowerStream,
    alignment: Alignment,
    merged: list[_Merged],
    early: list[str],
    pictures: Callable[[Path], None],
) -> BuildReport:
    report = BuildReport(str(order.out), robot.name, measured=power.measured)
    line = alignment.line
    if line is not None:
        report.offset_s, report.drift_ppm, report.scatter_ms = line.offset_s, line.drift_ppm, 1000 * line.scatter_s
    report.supply_lag_ms = 1000 * alignment.supply_lag_s
    entries: list[dict[str, Any]] = []
    kept = [(log, located, recording) for log, located, recording, _ in merged if recording is not None]
    seconds: dict[str, float] = {}
    sources = sources_of([recording.name for _, _, recording in kept])
    for _, _, recording in kept:
        source = sources[recording.name]
        seconds[source] = seconds.get(source, 0.0) + float(recording.valid.sum()) * order.step_s
    parts, kinds = split(seconds, order.seed), kinds_of(set(seconds))
    report.refused = early + [f"{log.path}: {reason}" for log, _, recording, reason in merged if recording is None]
    for log, located, recording in kept:
        if located.note:
            report.notes.append(f"{log.path}: {located.note}")
        source = sources[recording.name]
        report.split[parts[source]] = report.split.get(parts[source], 0) + 1
        entries.append(
            _entry(order, log, located, recording) | {"source": source, "kind": kinds[source], "split": parts[source]}
        )
    report.recordings = len(entries)
    report.seconds = sum(entry["valid_s"] for entry in entries)
    manifest = {
        "acqd": __version__,
        "robot": robot.name,
        "description": str(Path(order.robot).resolve()) if Path(order.robot).is_file() else order.robot,
        "measured": power.measured,
        "step_s": order.step_s,
        "power": _power_provenance(order, power),
        "clock": {"offset_s": report.offset_s, "drift_ppm": report.drift_ppm, "scatter_ms": report.scatter_ms},
        "supply_lag_s": alignment.supply_lag_s,
        "refused": report.refused,
        "recordings": entries,
    }
    _publish(order.out, [recording for _, _, recording in kept], manifest, pictures)
    return report


def _entry(order: BuildConfig, log: RobotLog, located: Located, recording: Recording) -> dict[str, Any]:
    return {
        "name": recording.name,
        "file": f"recordings/{recording.name}.parquet",
        "rows": len(recording.valid),
        "valid_s": float(recording.valid.sum()) * order.step_s,
        "lag_s": located.lag_s,
        "lag_by": located.method,
        "own_lag": {"s": located.own.seconds, "r2": located.own.r2, "stands_out": located.own.ratio},
        "note": located.note,
        "log": {"path": str(_file(log)), "sha256": _digest(_file(log)), "rows": len(log.time)},
    }


def _file(log: RobotLog) -> Path:
    """The file on disk: a piece of a log has its parent's."""
    return log.path if log.path.is_file() else log.path.parent


def _power_provenance(order: BuildConfig, power: PowerStream) -> dict[str, Any]:
    path = Path(order.power)
    return {
        "origin": order.power,
        "sha256": _digest(path) if path.is_file() else None,
        "rows": len(power.time_ns),
        "first_ns": int(power.time_ns[0]),
        "last_ns": int(power.time_ns[-1]),
        "duplicates_dropped": power.dropped,
        "window_ns": power.window_ns,
    }


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _report(
    order: BuildConfig,
    robot: RobotDescription,
    power: PowerStream,
    alignment: Alignment,
    merged: list[_Merged],
    explained: list[Explanation],
) -> Callable[[Path], None]:
    """What draws the thesis' figures of a typical recording; nothing where no lag was searched for."""
    placed = [k for k, (_, _, recording, _) in enumerate(merged) if recording is not None]
    if not explained or not placed:
        return lambda _: None
    typical = sorted(placed, key=lambda k: alignment.located[k].own.r2)[len(placed) // 2]
    log, located, recording, _ = merged[typical]
    assert recording is not None
    middles = np.array([float(about.t.mean()) for about in explained])
    shown = (log, explained[typical], located, recording)
    clock = (middles, alignment.located, alignment.line)
    title = f"Power and motion of {robot.title}: {order.out.name}"
    return lambda folder: write_report(folder / "report.html", title, power, shown, clock)


def _publish(
    out: Path, recordings: list[Recording], manifest: dict[str, Any], pictures: Callable[[Path], None]
) -> None:
    """All of it, or nothing."""
    with complete_folder(out) as folder:
        (folder / "recordings").mkdir()
        for recording in recordings:
            pyarrow.parquet.write_table(recording.table(), folder / "recordings" / f"{recording.name}.parquet")
        pictures(folder)
        (folder / "manifest.json").write_bytes(orjson.dumps(manifest, option=orjson.OPT_INDENT_2))
