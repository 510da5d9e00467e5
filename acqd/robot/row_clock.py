"""Whether the time stamps of a log are those of its poses, and times put right where a recorder stamped rows late.

An arm on its way tells the time: from row to row it covers a way that changes little. A recorder that stamps rows when
they arrive (a message late, ten messages in a packet) writes uneven stamps for even ways; the controller's rate is what
was even. So does a recorder that is slower than the controller: it misses a pose every few rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import running_line, runs_of_true
from acqd.robot.ways import FEWEST, Ways, at_another_rate, ways_of

_TRUSTED = 0.98
"""Share of the steps by which the scatter is known."""
_SMOOTHER = 5.0
"""Change of speed from row to row with the stamps as they are, over that with even times, from which on the even times
are the true ones. True late rows: 8 and more; a log that stops and goes, or has blocks of another rate: below 3."""
_WINDOW_S = 1.0
"""Span of the line through the stamps. A rate drifts by less than a row in it."""
_PAUSE_S = 0.6
"""Step between rows that is a pause of the recorder, not a late packet."""
_REST_OFF_S = 0.15
"""Difference of a time without motion from that of as many rows in motion, from which on rows may be missing in it."""
_RESTS = 3.0
"""Usual steps of one pose, written again and again, that are a rest."""
_EARLIEST = 0.02
"""Share of the rows that may lie before the line of the stamps that came at once."""
_FEWEST_LATE = 10
"""Steps beside late rows by which single late rows are known."""


@dataclass(frozen=True, slots=True)
class LateStamps:
    """Times of rows that a recorder stamped when they came."""

    time: Floats
    """[T] s, rising."""
    late_s: float
    """Mean delay of the stamps behind those that came at once."""
    most_s: float
    """Delay of the latest twentieth."""
    row_s: float
    """Usual time between rows."""

    shared: int = 0
    """Rows that had the stamp of the row before."""
    few: int = 0
    """Rows that came late, where the others have the controller's time; 0: all stamps are the recorder's."""

    @property
    def error_s(self) -> float:
        """By how much all times may be wrong together: how late the stamps that came at once are is not known."""
        return self.late_s / 2

    def sentence(self) -> str:
        """What a user should know."""
        if self.few:
            return (
                f"{self.few} of {len(self.time)} rows were stamped up to {1000 * self.most_s:.0f} ms late, although "
                "the arm moves on evenly: they were put at even distances from the others"
            )
        return (
            f"stamps are up to {1000 * self.most_s:.0f} ms late, although the arm moves on evenly every "
            f"{1000 * self.row_s:.3g} ms: they are of the recorder, not of the controller. The rows were put at even "
            "distances; record the controller's own time"
        )


def late_stamps(time: Floats, q: Floats, speed: Floats, q_step: Floats) -> LateStamps | None:
    """Times of the rows of angles [T, axes] if the stamps [T] s, rising, are a recorder's; None where they are not.

    `speed` [axes]: the speed limits; `q_step` [axes]: how finely positions are written.
    """
    new = np.concatenate([[True], (q[1:] != q[:-1]).any(axis=1)])  # a pose that is written again tells no time
    stamps = time[new]
    ways = ways_of(stamps, q[new] / speed, q_step / speed)
    if ways is None:
        return None
    steps = np.diff(stamps)
    rests = (np.diff(np.flatnonzero(new)) > 1) & (steps > _RESTS * ways.step_s)
    judged = ways.judged & ~rests
    if judged.sum() < FEWEST:
        return None
    rows = np.where(judged, np.maximum(np.rint(ways.way), 1.0), 1.0)  # rows that were lost count
    pauses = rests | (steps >= _PAUSE_S)
    row_s = float(steps[judged].sum() / rows[judged].sum())
    for start, end in runs_of_true(~judged):  # an arm that rests tells no time, but rows go on at the same rate
        span = stamps[end] - stamps[start]
        pauses[start:end] |= abs(span - row_s * (end - start)) > _REST_OFF_S
    even = even_times(stamps, rows=rows, pauses=pauses)
    moved = np.linalg.norm(np.diff(q[new] / speed, axis=0), axis=1)
    # a pose that a slower recorder reads is younger than the next one; a servo with a pace of its own has other delays
    beat = at_another_rate(judged & (rows == 2)) and even.most_s < even.row_s
    if not (beat or _are_uneven(ways, judged)) or not _clearly_smoother(even.time, stamps, moved, judged):
        few = _few_late(stamps, even, ways, moved, judged)
        if few is None:
            return None
        even = few
    times = time - np.interp(time, stamps, stamps - even.time)
    return replace(even, time=np.maximum.accumulate(times + 1e-9 * np.arange(len(times))))


def _few_late(
    stamps: Floats, even: LateStamps, ways: Ways, moved: Floats, judged: NDArray[np.bool_]
) -> LateStamps | None:
    """Times of stamps [T] s with those rows put right that came late, and the rows that waited behind them.

    None where the arm's speed is not clearly smoother beside them for it.
    """
    usual = even.time + float(np.median(stamps - even.time))
    late_s = stamps - usual
    late = late_s > even.row_s / 2
    beside = judged & (late[1:] | late[:-1])
    if beside.sum() < _FEWEST_LATE or not _are_uneven(ways, beside):
        return None
    time = np.maximum.accumulate(np.where(late, usual, stamps))
    if not _clearly_smoother(time, stamps, moved, beside):
        return None
    return replace(even, time=time, late_s=0.0, most_s=float(np.quantile(late_s[late], 0.95)), few=int(late.sum()))


def _are_uneven(ways: Ways, judged: NDArray[np.bool_]) -> bool:
    """Whether the stamps are less even than the arm's ways, in judged steps."""
    return _scatter(ways.way[judged] - 1) < _scatter(ways.step[judged] - 1)


def _clearly_smoother(even: Floats, stamps: Floats, moved: Floats, judged: NDArray[np.bool_]) -> bool:
    """Whether the arm's speed changes clearly less with even times [T] s than with the stamps, in judged steps."""
    return _changes(stamps, moved, judged) >= _SMOOTHER * _changes(even, moved, judged)


def even_times(
    time: Floats,
    *,
    window_s: float = _WINDOW_S,
    rows: Floats | None = None,
    pauses: NDArray[np.bool_] | None = None,
) -> LateStamps:
    """A line through the stamps of `window_s` around each row [T] s, as early as those that came at once.

    `rows` [T - 1]: rows by which each row is after the one before, 1 but where some were lost; `pauses` [T - 1]: steps
    across which nothing is even.
    """
    steps = np.diff(time)
    rows = np.ones(len(steps)) if rows is None else rows
    pauses = steps >= _PAUSE_S if pauses is None else pauses
    index = np.concatenate([[0.0], np.cumsum(rows)])
    row_s = float(steps[~pauses].sum() / max(rows[~pauses].sum(), 1.0))
    reach = max(round(window_s / 2 / row_s), 8)
    ends = np.flatnonzero(pauses) + 1
    out = np.concatenate(
        [running_line(time[start:end], index[start:end], reach, row_s)
         for start, end in zip([0, *ends.tolist()], [*ends.tolist(), len(time)], strict=True)]
    )  # fmt: skip
    late = time - out
    earliest = float(np.quantile(late, _EARLIEST))
    out = np.maximum.accumulate(out + min(earliest, 0.0) + 1e-9 * np.arange(len(out)))
    return LateStamps(out, max(-earliest, 0.0), float(np.quantile(late, 0.95)) - earliest, row_s)


def _changes(time: Floats, moved: Floats, judged: NDArray[np.bool_]) -> float:
    """Scatter of the changes of speed, as logarithms, from step to step of the judged ones."""
    steps = np.diff(time)
    speed = np.log(np.maximum(moved, 1e-12) / np.maximum(steps, 0.01 * float(np.median(steps))))
    return _scatter(np.diff(speed)[judged[1:] & judged[:-1]])


def _scatter(values: Floats) -> float:
    """Root mean square without the farthest few: a clock that was set once makes no uneven stamps."""
    squares = np.sort(values**2)
    return float(np.sqrt(squares[: int(_TRUSTED * len(squares))].mean()))
