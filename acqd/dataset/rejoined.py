"""The pieces of a log as one recording again: what a minute tells, a few seconds do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.cut import log_of_piece
from acqd.dataset.merge import Recording


def rejoined(recordings: Sequence[Recording], axes: int) -> list[Recording]:
    """Angles and power of each log, from its pieces with power; NaN and not valid where no piece has both."""
    logs: dict[str, list[Recording]] = {}
    for each in recordings:
        if each.valid.any():
            logs.setdefault(log_of_piece(each.name), []).append(each)
    return [_joined(name, pieces, axes) for name, pieces in logs.items()]


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
