"""`acqd dataset build`: merges logs and power rows into aligned recordings with provenance."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from acqd.dataset.column_check import check_columns
from acqd.dataset.config import BuildConfig, BuildReport
from acqd.dataset.cut import cut
from acqd.dataset.merge import merge
from acqd.dataset.merged_log import MergedLog
from acqd.dataset.placement import Alignment, given, place
from acqd.dataset.power import PowerStream, open_power
from acqd.dataset.regressors import Regressors, TorqueSource, regressors_of
from acqd.dataset.report import report_writer
from acqd.dataset.write import write_dataset
from acqd.errors import InputError, UserError
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log import RobotLog, read_log

__all__ = ["BuildConfig", "BuildReport", "build"]

_SUFFIXES = (".log", ".csv", ".txt")
_MIN_VALID_S = 2.0
_MIN_FOR_CLOCK = 4  # logs from which on a common clock is expected
_Progress = Callable[[str, float], None]


def build(config: BuildConfig, progress: _Progress) -> BuildReport:
    """Aligns, merges and writes; `config.out` appears complete or not at all. Raises UserError."""
    if config.out.exists():
        raise UserError(f"{config.out} exists; choose another --out, or remove it")
    robot = load_description(config.robot)
    paths = _log_files(config.logs)
    progress("reading power", 0.0)
    power = open_power(config.power, config.device, config.channel)
    logs = _read_logs(paths, robot, config.cut_s, progress)
    regressors: list[Regressors] = []
    refused: list[str] = []
    if config.lag_s is not None:
        alignment = given(len(logs), config.lag_s)
    else:
        logs, regressors, refused = _with_regressors(logs, robot, config.torque, progress)
        check_columns(logs, robot)
        names = [log.path.stem for log in logs]
        alignment = place(regressors, power, config.search_s, lambda share: progress("aligning", share), names)
    _require_placements(alignment)
    merged = _merge_all(config, logs, power, alignment)
    title = f"Power and motion of {robot.title}: {config.out.name}"
    write_report = report_writer(title, power, alignment, merged, regressors)
    report = write_dataset(config, robot, power, alignment, merged, refused, write_report)
    report.notes += alignment.notes
    if alignment.line is None and config.lag_s is None and len(logs) >= _MIN_FOR_CLOCK:
        report.notes.append("the logs' lags lie on no common clock line, so each has its own: are they of two robots?")
    return report


def _log_files(folder: Path) -> list[Path]:
    if folder.is_file():
        return [folder]
    paths = sorted(path for path in folder.rglob("*") if path.suffix in _SUFFIXES and path.is_file())
    if not paths:
        raise UserError(f"{folder}: no robot logs ({', '.join(_SUFFIXES)}) there")
    stems = [path.stem for path in paths]
    repeated = {stem for stem in stems if stems.count(stem) > 1}
    if repeated:
        raise UserError(f"{folder}: several logs named {min(repeated)}; build one dataset per robot")
    return paths


def _read_logs(paths: list[Path], robot: RobotDescription, cut_s: float | None, progress: _Progress) -> list[RobotLog]:
    logs = []
    for number, path in enumerate(paths):
        logs.append(read_log(path, robot))
        progress("reading logs", (number + 1) / len(paths))
    return logs if cut_s is None else [piece for log in logs for piece in cut(log, cut_s)]


def _with_regressors(
    logs: list[RobotLog], robot: RobotDescription, torque: TorqueSource | None, progress: _Progress
) -> tuple[list[RobotLog], list[Regressors], list[str]]:
    """Logs with their regressors, and for the other logs the reason. Raises InputError when no log is usable."""
    kept, regressors, refused = [], [], []
    for number, log in enumerate(logs):
        try:
            regressors.append(regressors_of(log, robot, torque))
            kept.append(log)
        except InputError as error:
            if number == len(logs) - 1 and not kept:
                raise
            refused.append(str(error))
        progress("computing regressors", (number + 1) / len(logs))
    return kept, regressors, refused


def _require_placements(alignment: Alignment) -> None:
    placements = alignment.placements
    if all(placement.method == "refused" for placement in placements):
        raise UserError(
            f"none of {len(placements)} logs can be placed in the power stream (best R2 "
            f"{max(placement.own.r2 for placement in placements):.2f}): is it this robot's power, of these days?"
        )


def _merge_all(config: BuildConfig, logs: list[RobotLog], power: PowerStream, alignment: Alignment) -> list[MergedLog]:
    drift = alignment.line.drift_ppm if alignment.line else 0.0
    merged: list[MergedLog] = []
    for log, placement in zip(logs, alignment.placements, strict=True):
        if placement.method == "refused":
            merged.append(MergedLog(log, placement, None, placement.note))
            continue
        recording = merge(log.path.stem, log, power, placement.lag_s, drift, config.step_s)
        if recording.valid.sum() * config.step_s < _MIN_VALID_S:
            merged.append(MergedLog(log, placement, None, "no power rows in its time span"))
        else:
            merged.append(MergedLog(log, placement, recording))
    if all(single.recording is None for single in merged):
        raise UserError(
            "no log overlaps the power stream: are they of the same days? --search SECONDS widens the search"
        )
    return merged
