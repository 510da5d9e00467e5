"""Writes a dataset: recordings as Parquet, the manifest with hashes and lags, the split, the report."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import orjson
import pyarrow.parquet

from acqd import __version__
from acqd.atomic import complete_folder
from acqd.dataset.config import BuildConfig, BuildReport
from acqd.dataset.merge import Recording
from acqd.dataset.merged_log import MergedLog
from acqd.dataset.placement import Alignment
from acqd.dataset.power import PowerStream
from acqd.dataset.split import kinds_of, sources_of, split
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog


def write_dataset(
    config: BuildConfig,
    robot: RobotDescription,
    power: PowerStream,
    alignment: Alignment,
    merged: list[MergedLog],
    refused: list[str],
    write_report: Callable[[Path], None],
) -> BuildReport:
    """Writes the whole folder `config.out`; `refused` are logs that were refused before the alignment."""
    report = BuildReport(str(config.out), robot.name, measured=power.measured)
    line = alignment.line
    if line is not None:
        report.offset_s, report.drift_ppm, report.scatter_ms = line.offset_s, line.drift_ppm, 1000 * line.scatter_s
    report.supply_lag_ms = 1000 * alignment.supply_lag_s
    report.refused = refused + [f"{single.log.path}: {single.reason}" for single in merged if single.recording is None]
    entries: list[dict[str, Any]] = []
    recordings = [single.recording for single in merged if single.recording is not None]
    trajectories = _trajectories(recordings, config)
    for single in merged:
        if single.recording is None:
            continue
        if single.placement.note:
            report.notes.append(f"{single.log.path}: {single.placement.note}")
        entries.append(_entry(config, single, single.recording) | trajectories[single.recording.name])
        part = entries[-1]["split"]
        report.split[part] = report.split.get(part, 0) + 1
    report.recordings = len(entries)
    report.seconds = sum(entry["valid_s"] for entry in entries)
    manifest = {
        "acqd": __version__,
        "robot": robot.name,
        "description": str(Path(config.robot).resolve()) if Path(config.robot).is_file() else config.robot,
        "measured": power.measured,
        "step_s": config.step_s,
        "power": _power_provenance(config, power),
        "clock": {"offset_s": report.offset_s, "drift_ppm": report.drift_ppm, "scatter_ms": report.scatter_ms}
        | {"steps": [{"time_s": step.time_s, "seconds": step.seconds} for step in line.steps] if line else []},
        "supply_lag_s": alignment.supply_lag_s,
        "supply_lag_within_s": alignment.supply_within_s,
        "refused": report.refused,
        "recordings": entries,
    }
    with complete_folder(config.out) as folder:
        (folder / "recordings").mkdir()
        for recording in recordings:
            pyarrow.parquet.write_table(recording.table(), folder / "recordings" / f"{recording.name}.parquet")
        write_report(folder)
        (folder / "manifest.json").write_bytes(orjson.dumps(manifest, option=orjson.OPT_INDENT_2))
    return report


def _trajectories(recordings: list[Recording], config: BuildConfig) -> dict[str, dict[str, str]]:
    """Source, kind and split of each recording, by its name."""
    sources = sources_of([recording.name for recording in recordings])
    seconds: dict[str, float] = {}
    for recording in recordings:
        source = sources[recording.name]
        seconds[source] = seconds.get(source, 0.0) + float(recording.valid.sum()) * config.step_s
    parts, kinds = split(seconds, config.seed), kinds_of(set(seconds))
    return {name: {"source": source, "kind": kinds[source], "split": parts[source]} for name, source in sources.items()}


def _entry(config: BuildConfig, merged: MergedLog, recording: Recording) -> dict[str, Any]:
    placement, file = merged.placement, _file(merged.log)
    return {
        "name": recording.name,
        "file": f"recordings/{recording.name}.parquet",
        "rows": len(recording.valid),
        "valid_s": float(recording.valid.sum()) * config.step_s,
        "lag_s": placement.lag_s,
        "lag_within_s": placement.within_s,
        "lag_by": placement.method,
        "own_lag": {"s": placement.own.seconds, "r2": placement.own.r2, "stands_out": placement.own.ratio},
        "note": placement.note,
        "log": {"path": str(file), "sha256": _digest(file), "rows": len(merged.log.time)},
    }


def _file(log: RobotLog) -> Path:
    """The file on disk; a piece of a log has a path below the file."""
    return log.path if log.path.is_file() else log.path.parent


def _power_provenance(config: BuildConfig, power: PowerStream) -> dict[str, Any]:
    path = Path(config.power)
    return {
        "origin": config.power,
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
