"""The pieces of a log as one recording again: what a minute tells, a few seconds do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.cut import CONTEXT_ROWS
from acqd.dataset.merge import Recording
from acqd.dataset.split import log_name

_LONGEST_GAP_S = 60.0
"""Between two pieces of a log; logs of like names may lie days apart."""


def rejoined(recordings: Sequence[Recording], axes: int) -> list[Recording]:
    """Angles and power of each log, from its pieces with power; NaN and not valid where no piece has both."""
    runs: list[list[Recording]] = []
    for each in sorted(recordings, key=lambda recording: (log_name(recording.name), int(recording.time_ns[0]))):
        if not each.valid.any():
            continue
        if runs and _follows(each, runs[-1][-1]):
            runs[-1].append(each)
        else:
            runs.append([each])
    return [_joined(log_name(pieces[0].name), pieces, axes) for pieces in runs]


def _follows(piece: Recording, before: Recording) -> bool:
    """Whether a piece is of the same log, and begins where the one before ends; both hold rows of the other."""
    gap_s = float(piece.time_ns[0] - before.time_ns[-1]) * 1e-9
    shared_s = (2 * CONTEXT_ROWS + 1) * float(np.median(np.diff(before.time_ns))) * 1e-9
    return log_name(piece.name) == log_name(before.name) and -shared_s <= gap_s <= _LONGEST_GAP_S


def _joined(name: str, pieces: Sequence[Recording], axes: int) -> Recording:
    if len(pieces) == 1:
        return pieces[0]
    first, step_ns = min(int(each.time_ns[0]) for each in pieces), float(np.median(np.diff(pieces[0].time_ns)))
    rows = [np.rint((each.time_ns - first) / step_ns).astype(np.int64)[each.valid] for each in pieces]
    count = 1 + max(int(at.max()) for at in rows)
    names = ["P", *(f"q{axis + 1}" for axis in range(axes))]
    columns: dict[str, Floats] = {column: np.full(count, np.nan) for column in names}
    valid = np.zeros(count, bool)
    for at, each in zip(rows, pieces, strict=True):
        valid[at] = True
        for column in names:
            columns[column][at] = each.columns[column][each.valid]
    time_ns = first + np.rint(step_ns * np.arange(count)).astype(np.int64)
    return Recording(name, time_ns, columns, valid)
