"""Writes a dataset: recordings as Parquet, the manifest with hashes and lags, the split, the report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import orjson

from acqd import __version__
from acqd.dataset.config import BuildConfig, BuildReport
from acqd.dataset.growing import Existing, write_more, write_new
from acqd.dataset.log_files import content_hash
from acqd.dataset.merge import Recording
from acqd.dataset.merged_log import Batch, MergedLog
from acqd.dataset.power import PowerStream
from acqd.dataset.split import source_of, with_split
from acqd.errors import UserError
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog
from acqd.storage.url import shown


def write_dataset(
    config: BuildConfig,
    robot: RobotDescription,
    batch: Batch,
    before: Existing,
    write_report: Callable[[Path], None],
) -> BuildReport:
    """Writes the folder `config.out`, or puts the recordings into it where it exists.

    Raises UserError, OperationError.
    """
    alignment, version = batch.alignment, before.manifest.get("version", 1) + 1 if before.manifest else 1
    report = BuildReport(str(config.out), robot.name, version, measured=batch.powers[0].measured, known=batch.known)
    _require_same_power(config, before, report.measured)
    line = alignment.line
    if line is not None:
        report.offset_s, report.drift_ppm, report.scatter_ms = line.offset_s, line.drift_ppm, 1000 * line.scatter_s
    report.supply_lag_ms = 1000 * alignment.supply_lag_s
    left_out = [f"{single.log.path}: {single.reason}" for single in batch.merged if single.recording is None]
    report.refused = batch.refused + left_out
    recordings = [single.recording for single in batch.merged if single.recording is not None]
    new = [_entry(config, single, single.recording) for single in batch.merged if single.recording is not None]
    entries = with_split([*before.manifest.get("recordings", []), *new], config.seed)
    new = entries[len(entries) - len(new) :]
    for entry in new:
        report.split[entry["split"]] = report.split.get(entry["split"], 0) + 1
    placed = [single for single in batch.merged if single.recording is not None]
    report.own_lags_s = [each.placement.lag_s for each in placed if line is None and each.placement.method == "own"]
    noted = [f"{single.log.path}: {single.placement.note}" for single in placed if single.placement.note]
    report.notes = [*noted, *batch.notes, *_about_sources(new)]
    report.recordings, report.seconds = len(new), sum(entry["valid_s"] for entry in new)
    provenance = {
        "acqd": __version__,
        "power": power_provenance(config, batch.powers),
        "clock": {"offset_s": report.offset_s, "drift_ppm": report.drift_ppm, "scatter_ms": report.scatter_ms}
        | {
            "steps": [
                {"time_s": step.time_s, "seconds": step.seconds}
                for step in (alignment.line.steps if alignment.line else ())
            ]
        },
        "supply_lag_s": alignment.supply_lag_s,
        "supply_lag_within_s": alignment.supply_within_s,
    }
    first = {
        "robot": robot.name,
        "description": str(Path(config.robot).resolve()) if Path(config.robot).is_file() else config.robot,
        "measured": report.measured,
        "step_s": config.step_s,
        **provenance,
    }
    manifest = (before.manifest or first) | {
        "version": version,
        "refused": list(dict.fromkeys([*before.manifest.get("refused", []), *report.refused])),
        "recordings": entries,
    }
    if before.manifest:
        here = provenance | {"version": version, "recordings": [entry["name"] for entry in new]}
        manifest["appended"] = [*before.manifest.get("appended", []), here]
    content = orjson.dumps(manifest, option=orjson.OPT_INDENT_2)

    def fill(folder: Path) -> None:
        (folder / "recordings").mkdir()
        for recording in recordings:
            recording.write(folder / "recordings", robot.sliding)
        write_report(folder)

    if before.manifest:
        write_more(config.out, before, content, version, fill)
    else:
        write_new(config.out, content, fill)
    return report


def _require_same_power(config: BuildConfig, before: Existing, measured: str) -> None:
    present = before.manifest.get("measured", measured)
    if present != measured:
        raise UserError(f"{config.out} holds {present} power, the new recordings have {measured} power")


def _about_sources(entries: list[dict[str, Any]]) -> list[str]:
    """A note where files with the numbers of executions are separate sources."""
    alone = [entry for entry in entries if entry["source"] != source_of(entry["source"])]
    if not alone:
        return []
    name = alone[0]["source"]
    return [f"{name} and others are split as trajectories of their own: {source_of(name)} would be too few to split"]


def _entry(config: BuildConfig, merged: MergedLog, recording: Recording) -> dict[str, Any]:
    placement, file = merged.placement, _file(merged.log)
    return {
        "name": recording.name,
        "file": f"recordings/{recording.name}.parquet",
        "rows": len(recording.valid),
        "context_rows": 0 if recording.context is None else int(recording.context.sum()),
        "valid_s": float(recording.valid.sum()) * config.step_s,
        "lag_s": placement.lag_s,
        "lag_within_s": placement.within_s,
        "lag_by": placement.method,
        "own_lag": {"s": placement.own.seconds, "r2": placement.own.r2, "stands_out": placement.own.ratio},
        "note": placement.note,
        **({"worked_min": config.worked_min} if config.worked_min else {}),
        "motion": merged.log.quality.as_json() | {"unknown_ends": recording.unknown_ends},
        "log": {"path": str(file), "sha256": content_hash(file), "rows": len(merged.log.time)},
    }


def _file(log: RobotLog) -> Path:
    """The log on disk; a piece of a log has a path below it."""
    return log.path if log.path.exists() else log.path.parent


def power_provenance(config: BuildConfig, powers: list[PowerStream]) -> dict[str, Any]:
    """Where the power comes from, for the manifest."""
    path = Path(config.power)
    return {
        "origin": shown(config.power),  # datasets are handed on: no password
        "sha256": content_hash(path) if path.is_file() else None,
        "rows": sum(len(power.time_ns) for power in powers),
        "first_ns": min(int(power.time_ns[0]) for power in powers),
        "last_ns": max(int(power.time_ns[-1]) for power in powers),
        "duplicates_dropped": sum(power.dropped for power in powers),
        "window_ns": powers[0].window_ns,
    }
