"""`acqd dataset build`: merges logs and power rows into aligned recordings with provenance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from acqd.dataset.column_check import check_columns, check_each, doubt_robot, judge_logs, judge_recordings, to_check
from acqd.dataset.config import BuildConfig, BuildReport
from acqd.dataset.cut import AUTO, automatic_length, cut, cut_at_rests
from acqd.dataset.growing import Existing, existing
from acqd.dataset.log_files import Logs, read_logs, uncommon_columns
from acqd.dataset.log_power import LOG, log_power, require_drawn, small_power, some_power
from acqd.dataset.merge import Recording, merge
from acqd.dataset.merged_log import Batch, MergedLog
from acqd.dataset.motion_notes import end_notes, unused_notes
from acqd.dataset.no_overlap import far_apart, no_overlap
from acqd.dataset.placement import Alignment, given, place
from acqd.dataset.power import PowerStream, open_power, require_fast
from acqd.dataset.power_values import large_power
from acqd.dataset.regressors import Regressors, regressors_of
from acqd.dataset.rejoined import rejoined
from acqd.dataset.report import report_writer
from acqd.dataset.unaligned import clock_doubts, pair_of
from acqd.dataset.write import write_dataset
from acqd.errors import InputError, UserError
from acqd.report.chain import REPORT, connect
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log import RobotLog, in_time

__all__ = ["BuildConfig", "BuildReport", "build"]

_MIN_VALID_S = 2.0
_MIN_FOR_CLOCK = 4  # logs from which on a common clock is expected
_FEW = 4  # recordings that training and the loop need
_LONG_S = 20.0  # one log of this length is cut even if nobody asked: three pieces
_CONFIRMED = 0.75
"""Share of the logs that must be placed where no common clock confirms their places."""
_CAUSES = (
    "Otherwise the logs may be of another robot (--robot), an axis may have another sign, zero or place in the order "
    "than in the description, the angles another unit (degrees, turns), their rows may be in reverse order of time, or "
    "the meter may average or repeat its values"
)
_SQLITE = "sqlite:///"
_Progress = Callable[[str, float], None]


def build(config: BuildConfig, progress: _Progress) -> BuildReport:
    """Aligns, merges and writes; `config.out` appears complete or not at all, as does what is appended to it.

    Raises UserError.
    """
    if config.lag_s is not None and not math.isfinite(config.lag_s):
        raise UserError(f"--lag {config.lag_s}: expected seconds that the robot's clock is ahead")
    robot = load_description(config.robot)
    before = existing(config, robot)
    progress("reading power", 0.0)
    stream = None if config.power == LOG else open_power(config.power, config.device, config.channel, zone=config.zone)
    if stream is not None:
        require_drawn(stream)
        if config.lag_s is None:
            require_fast(stream)
    logs = read_logs(config.logs, robot, before.logs, before.names, lambda share: progress("reading logs", share))
    unlike = check_each(logs.kept, robot)
    if unlike:
        logs.keep(lambda log: _require_alike(log, unlike), lambda _: None)
    if to_check(logs.kept, robot):
        logs.keep(lambda log: check_columns(log, robot), lambda _: None)
    by_torque = judge_logs(logs.kept, robot)
    logs.notes += doubt_robot(logs.kept, robot) + uncommon_columns(logs.kept)
    _cut(logs, config, robot, before)
    if stream is None:
        powers = logs.keep(log_power, lambda share: progress("reading power", share))
        regressors: list[Regressors] = []
        alignment = given(len(logs.kept), config.lag_s or 0.0)
        if not config.lag_s:
            logs.notes.append("power and motion are in the same logs, with one clock: nothing was aligned")
    else:
        regressors, alignment = _align(logs, config, robot, stream, progress)
        powers = [stream]
    logs.notes += [note for power in powers for note in power.notes]
    logs.notes += small_power(powers)
    logs.notes += [note] if (note := large_power(np.concatenate([some_power(each) for each in powers]), robot)) else []
    if stream is not None and config.lag_s is None:
        placed = [each.lag_s for each in alignment.placements if each.method != "refused"]
        logs.notes += far_apart(placed, powers, logs.kept)
    _require_placements(alignment, [fault.text for log in logs.kept if (fault := log.quality.fault)])
    merged = _merge_all(config, logs.kept, powers, alignment)
    recordings = [each.recording for each in merged if each.recording]
    # power of another time fits no order of the axes
    doubts = _clock_doubts(config, robot, logs.kept, stream, recordings)
    logs.notes += doubts or judge_recordings(recordings, robot, by_torque)
    logs.notes += unused_notes(recordings) + end_notes(recordings, config.step_s)
    logs.notes += alignment.notes
    if alignment.line is None and config.lag_s is None and stream is not None and len(logs.kept) >= _MIN_FOR_CLOCK:
        logs.notes.append("the logs' lags lie on no common clock line, so each has its own: are they of two robots?")
    title = f"Power and motion of {robot.title}: {config.out.name}"
    batch = Batch(powers, alignment, merged, logs.refused, logs.notes, logs.known)
    report = write_dataset(config, robot, batch, before, report_writer(title, config, batch, regressors))
    page = REPORT if report.version == 1 else f"report-{report.version}.html"
    connect(config.out / page, [Path(config.power.removeprefix(_SQLITE)).parent / REPORT, config.out / REPORT])
    return report


def _clock_doubts(
    config: BuildConfig, robot: RobotDescription, logs: list[RobotLog], stream: PowerStream | None,
    recordings: list[Recording],
) -> list[str]:  # fmt: skip
    """A line where power and motion that were not aligned do not belong together in time."""
    if stream is None:
        pairs = [pair_of(each, robot, config.step_s) for each in rejoined(recordings, robot.axes)]
        given_s = config.lag_s or 0.0
        return clock_doubts(pairs, robot, lambda beyond_s: f"give --lag {given_s + beyond_s:.3f}")
    if config.lag_s is None:
        return []
    pairs = [(log, stream) for log in logs]
    return clock_doubts(pairs, robot, lambda lag_s: f"leave out --lag, or give --lag {lag_s:.3f}", config.lag_s)


def _require_alike(log: RobotLog, unlike: dict[Path, str]) -> None:
    if log.path in unlike:
        raise InputError(log.path, unlike[log.path])


def _cut(logs: Logs, config: BuildConfig, robot: RobotDescription, before: Existing) -> None:
    """Cuts the logs as ordered, or by default a single long one, and notes how the length was chosen."""
    length = config.cut_s
    seconds = [float(np.ptp(in_time(log)[0])) for log in logs.kept]
    if length is None and not before.names and 1 < len(logs.kept) < _FEW and min(seconds) >= _LONG_S:
        logs.notes.append(
            f"{len(logs.kept)} recordings are too few for training, test and the loop: --cut auto cuts them into pieces"
        )
    if length is None and not before.names and len(logs.kept) == 1 and np.ptp(in_time(logs.kept[0])[0]) >= _LONG_S:
        # short pieces are harder to align than the whole
        length = AUTO if config.power == LOG or config.lag_s is not None else None
        if length is None:
            logs.notes.append("one recording cannot be split into training and test: --cut auto cuts it into pieces")
    if not length:
        return
    if length != AUTO:
        pieces = logs.keep(lambda log: cut(log, float(length), config.step_s), lambda _: None)
        logs.kept = [piece for several in pieces for piece in several]
        return
    chosen = automatic_length(logs.kept)
    results = logs.keep(lambda log: cut_at_rests(log, chosen, config.step_s, robot.speed), lambda _: None)
    cuts = sum(len(several) - 1 for several, _ in results)
    moving = sum(number for _, number in results)
    logs.kept = [piece for several, _ in results for piece in several]
    if not cuts:
        logs.notes.append(f"nothing was cut: {len(logs.kept)} logs of at most 60 s")
        return
    spans = [piece.core[1] - piece.core[0] for piece in logs.kept if piece.core]
    logs.notes.append(
        f"cut into {len(logs.kept)} pieces of {min(spans):.1f} to {max(spans):.1f} s: about twenty fill the split, 5 s "
        f"are the least for the noise model; {cuts - moving} of {cuts} cuts are where the arm rests "
        "(--cut SECONDS for another length, --cut 0 for none)"
    )


def _align(
    logs: Logs, config: BuildConfig, robot: RobotDescription, stream: PowerStream, progress: _Progress
) -> tuple[list[Regressors], Alignment]:
    """Regressors (none if the lag is given) and places of all logs; logs that have none are refused."""
    if config.lag_s is not None:
        return [], given(len(logs.kept), config.lag_s)
    regressors = logs.keep(
        lambda log: regressors_of(log, robot, config.torque), lambda share: progress("computing regressors", share)
    )
    if not any(np.ptp(log.q, axis=0).any() for log in logs.kept):
        raise UserError(
            f"the arm stands still in {'the log' if len(logs.kept) == 1 else 'all logs'}: without motion no lag "
            "can be found; give logs of motion, or --lag if it is known"
        )
    names = [log.path.stem for log in logs.kept]
    return regressors, place(regressors, stream, config.search_s, lambda share: progress("aligning", share), names)


def _require_placements(alignment: Alignment, faults: Sequence[str] = ()) -> None:
    """Raises UserError where no log has a place, or so few that chance may have found theirs.

    `faults`: what is doubtful in the times of logs.
    """
    placements = alignment.placements
    placed = [placement for placement in placements if placement.method != "refused"]
    doubtful = f"The times of {len(faults)} of them are doubtful, the first: {faults[0]}. " if faults else ""
    causes = f"{doubtful}{_CAUSES}"
    best = f"best R2 {max(placement.own.r2 for placement in placements):.2f}"
    if not placed:
        raise UserError(
            f"none of {len(placements)} logs can be placed in the power stream ({best}): is it this robot's power, of "
            f"these days? {causes}"
        )
    if alignment.line is None and len(placements) >= _MIN_FOR_CLOCK and len(placed) < _CONFIRMED * len(placements):
        raise UserError(
            f"only {len(placed)} of {len(placements)} logs can be placed in the power stream ({best}), on no common "
            f"clock: such places may be chance. {causes}"
        )


def _merge_all(
    config: BuildConfig, logs: list[RobotLog], powers: list[PowerStream], alignment: Alignment
) -> list[MergedLog]:
    drift = alignment.line.drift_ppm if alignment.line else 0.0
    streams = powers if len(powers) == len(logs) else powers * len(logs)
    merged: list[MergedLog] = []
    for log, placement, power in zip(logs, alignment.placements, streams, strict=True):
        if placement.method == "refused":
            merged.append(MergedLog(log, placement, None, placement.note))
            continue
        try:
            recording = merge(log.path.stem, log, power, placement.lag_s, drift, config.step_s)
        except InputError as error:  # the log's clock
            merged.append(MergedLog(log, placement, None, str(error).removeprefix(f"{log.path}: ")))
            continue
        if recording.valid.sum() * config.step_s < _MIN_VALID_S:
            merged.append(MergedLog(log, placement, None, "no power rows in its time span"))
        else:
            merged.append(MergedLog(log, placement, recording))
    if all(single.recording is None for single in merged):
        raise UserError(no_overlap(powers, logs))
    return merged
