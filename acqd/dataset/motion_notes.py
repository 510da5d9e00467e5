"""What the user should know about the rows of many logs: one line for each log, or one for all of a kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.dataset.merge import Recording
from acqd.report.digits import percent
from acqd.robot.log import RobotLog
from acqd.robot.log_ends import sentence

_SAID = 0.01
"""Share of the rows that are not used, from which on a line says so."""
_EACH = 3
"""Up to so many logs have a line each."""


def motion_notes(logs: list[RobotLog]) -> list[str]:
    """Lines on rows that were left out, unwrapped angles and quantities that are not measured."""
    faulty = [log for log in logs if log.quality.sentences()]
    if len(faulty) <= _EACH:
        return [f"{log.path}: {'; '.join(log.quality.sentences())}" for log in faulty]
    worst = max(faulty, key=lambda log: log.quality.bad_share)
    notes = [f"{log.path}: {log.quality.rebuilt.sentence()}" for log in faulty if log.quality.rebuilt][:1]
    notes += [f"{log.path}: {log.quality.fault.text}" for log in faulty if log.quality.fault][:1]
    smooth = [log for log in faulty if log.quality.smoothing]
    if smooth:
        log = max(smooth, key=lambda log: log.quality.smoothing.longest_s if log.quality.smoothing else 0.0)
        assert log.quality.smoothing is not None
        notes.append(f"the motion of {len(smooth)} logs is smoothed; {log.path}: {log.quality.smoothing.sentence()}")
    if worst.quality.left_out():
        left_out = sum(log.quality.bad for log in faulty)
        share = left_out / max(sum(log.quality.moving for log in logs), 1)
        notes.append(
            f"{left_out} rows ({percent(share)} of those in motion) of "
            f"{sum(log.quality.bad > 0 for log in faulty)} logs do not hold the pose of their time; "
            f"the worst, {worst.path}: {'; '.join(worst.quality.left_out())}"
        )
    drawn = [log for log in faulty if log.quality.drawn_s]
    if drawn:
        worst_s = max(log.quality.drawn_s for log in drawn)
        notes.append(
            f"the rows of {len(drawn)} logs were computed from poses up to {1000 * worst_s:.0f} ms apart (the first: "
            f"{drawn[0].path}): motion above {0.5 / worst_s:.2g} Hz is not in them; give the logs as they were recorded"
        )
    for what, names in (
        ("jumps by whole turns were unwrapped", {log.path: log.quality.unwrapped for log in faulty}),
        ("is often that of an earlier row while other joints move on: record all joints in every row",
         {log.path: log.quality.by_itself for log in faulty}),
        ("stays while the joint moves on, and then jumps: rows were left out",
         {log.path: log.quality.frozen for log in faulty}),
        ("never changes while the arm moves, and counts as not measured",
         {log.path: log.quality.unmeasured for log in faulty}),
        ("has few digits: the speed is integrated, and held to it",
         {log.path: log.quality.by_speeds for log in faulty}),
        ("left out", {log.path: log.quality.unusable for log in faulty}),
    ):  # fmt: skip
        concerned = {path: named for path, named in names.items() if named}
        if concerned:
            listed = ", ".join(sorted({name for named in concerned.values() for name in named}))
            notes.append(f"{listed}: {what} ({len(concerned)} logs, the first: {next(iter(concerned))})")
    return notes


def unused_notes(recordings: list[Recording]) -> list[str]:
    """A line on rows of recordings that have no power, or no pose."""
    rows = sum(len(each.valid) for each in recordings)
    unused = sum(int((~_of_piece(each)).sum()) - each.unknown_ends for each in recordings)
    share = unused / max(rows, 1)
    if share < _SAID:
        return []
    worst = max(recordings, key=lambda each: float((~_of_piece(each)).mean()))
    return [
        f"{percent(share)} of the rows of the recordings have no power or no pose (gaps, empty cells, flags), most "
        f"of them in {worst.name}: no model uses them"
    ]


def _of_piece(recording: Recording) -> NDArray[np.bool_]:
    """[T] rows with power, and rows of neighbouring pieces before the first and after the last of them."""
    used = np.flatnonzero(recording.valid)
    rows = np.arange(len(recording.valid))
    return recording.valid | (rows < used[0]) | (rows > used[-1]) if len(used) else recording.valid


def end_notes(recordings: list[Recording], step_s: float) -> list[str]:
    """A line on recordings that begin or end in motion."""
    moving = [each for each in recordings if each.unknown_ends]
    if not moving:
        return []
    first = f"{moving[0].name}: {sentence(moving[0].unknown_ends, step_s)}"
    if len(moving) == 1:
        return [first]
    return [f"{len(moving)} of {len(recordings)} recordings begin or end in motion, the first, {first}"]
