"""Whether the time stamps of a log are those of its poses, and times put right where a recorder stamped rows late.

An arm on its way tells the time: from row to row it covers a way that changes little. A recorder that stamps rows when
they arrive (a message late, ten messages in a packet) writes uneven stamps for even ways; the controller's rate is what
was even. A recorder whose stamps count rows shows an even clock and, where a row is missing, a way twice as long. A
clock that was set goes on by a second while the arm moved on by a row. Two recorders in one file let the arm go to and
fro.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import mad_sigma, running_line, runs_of_true

_AROUND = 4
"""Rows on either side that tell the usual way and step."""
_TRUSTED = 0.98
"""Share of the steps by which the scatter is known."""
_FAST = 0.02
"""Share of the speed limits from which on a way tells the time."""
_STEPS_OF_ENCODER = 12.0
"""Steps of the written positions that a way needs."""
_FEWEST = 60
"""Rows in motion that are judged."""
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
_TWICE = (0.6, 0.25)
"""Ways beyond the usual one of a step across a missing row, and of its neighbours."""
_MISSING, _MISSING_SHARE = 5, 0.004
"""Such steps (twice as many beside late rows), and their share of the rows in motion, from which on a line says so."""
_CALM = 0.1
"""Scatter of the ways up to which a way of two rows is known."""
_SET_ROWS, _SET_S = 5.0, 0.04
"""Usual steps, and s, by which the stamps go on while the arm covers the way of one row."""
_AHEAD = 0.5
"""Distance covered over the ways between, of an arm that goes somewhere. The noise of encoders covers a ninth."""
_TO_AND_FRO, _TO_AND_FRO_SHARE = 3.0, 0.5
"""Way of two rows over their distance, and the share of the rows in motion, from which on the arm goes to and fro. The
noise of encoders goes twice as far."""


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


@dataclass(frozen=True, slots=True)
class _Ways:
    """What the steps between rows [T - 1] say; unjudged ones are NaN."""

    step: Floats
    """Step of the stamps over the usual one around it."""
    way: Floats
    """Way of the arm over the usual one around it."""
    three: Floats
    """Distance that the step and its neighbours cover together, over the usual way of one."""
    step_s: Floats
    """Usual step around it, s."""
    fast: NDArray[np.bool_]
    """Steps of a usual way, on the way to somewhere or to and fro."""

    @property
    def judged(self) -> NDArray[np.bool_]:
        return np.isfinite(self.way)


def late_stamps(time: Floats, q: Floats, speed: Floats, q_step: Floats) -> LateStamps | None:
    """Times of the rows of angles [T, axes] if the stamps [T] s, rising, are a recorder's; None where they are not.

    `speed` [axes]: the speed limits; `q_step` [axes]: how finely positions are written.
    """
    new = np.concatenate([[True], (q[1:] != q[:-1]).any(axis=1)])  # a pose that is written again tells no time
    stamps = time[new]
    ways = _ways(stamps, q[new] / speed, q_step / speed)
    if ways is None:
        return None
    steps = np.diff(stamps)
    rests = (np.diff(np.flatnonzero(new)) > 1) & (steps > _RESTS * ways.step_s)
    judged = ways.judged & ~rests
    if judged.sum() < _FEWEST:
        return None
    rows = np.where(judged, np.maximum(np.rint(ways.way), 1.0), 1.0)  # rows that were lost count
    pauses = rests | (steps >= _PAUSE_S)
    row_s = float(steps[judged].sum() / rows[judged].sum())
    for start, end in runs_of_true(~judged):  # an arm that rests tells no time, but rows go on at the same rate
        span = stamps[end] - stamps[start]
        pauses[start:end] |= abs(span - row_s * (end - start)) > _REST_OFF_S
    even = even_times(stamps, rows=rows, pauses=pauses)
    moved = np.linalg.norm(np.diff(q[new] / speed, axis=0), axis=1)
    if not _are_uneven(ways, judged) or not _clearly_smoother(even.time, stamps, moved, judged):
        few = _few_late(stamps, even, ways, moved, judged)
        if few is None:
            return None
        even = few
    times = time - np.interp(time, stamps, stamps - even.time)
    return replace(even, time=np.maximum.accumulate(times + 1e-9 * np.arange(len(times))))


def _few_late(
    stamps: Floats, even: LateStamps, ways: _Ways, moved: Floats, judged: NDArray[np.bool_]
) -> LateStamps | None:
    """Times of stamps [T] s with those rows put right that came late, and the rows that waited behind them.

    None where the arm's speed is not clearly smoother beside them for it.
    """
    usual = even.time + float(np.median(stamps - even.time))
    late_s = stamps - usual
    late = late_s > even.row_s / 2
    beside = judged & (late[1:] | late[:-1])
    if beside.sum() < 2 * _MISSING or not _are_uneven(ways, beside):
        return None
    time = np.maximum.accumulate(np.where(late, usual, stamps))
    if not _clearly_smoother(time, stamps, moved, beside):
        return None
    return replace(even, time=time, late_s=0.0, most_s=float(np.quantile(late_s[late], 0.95)), few=int(late.sum()))


def _are_uneven(ways: _Ways, judged: NDArray[np.bool_]) -> bool:
    """Whether the stamps are less even than the arm's ways, in judged steps."""
    return _scatter(ways.way[judged] - 1) < _scatter(ways.step[judged] - 1)


def _clearly_smoother(even: Floats, stamps: Floats, moved: Floats, judged: NDArray[np.bool_]) -> bool:
    """Whether the arm's speed changes clearly less with even times [T] s than with the stamps, in judged steps."""
    return _changes(stamps, moved, judged) >= _SMOOTHER * _changes(even, moved, judged)


@dataclass(frozen=True, slots=True)
class ClockFault:
    """Why stamps cannot be those of the poses."""

    text: str
    row: int | None = None
    """Where; None: in the whole log."""
    missing_s: float = 0.0
    """Time of the rows in motion that are missing without a trace in the stamps."""
    refused: bool = True
    """No lag can be right."""


def clock_fault(
    time: Floats, q: Floats, speed: Floats, q_step: Floats, left_out: NDArray[np.bool_] | None = None
) -> ClockFault | None:
    """Why stamps [T] s, rising, cannot be those of the poses [T, axes], all different; None where they can.

    `left_out` [T - 1]: steps across which equal poses were left out.
    """
    ways = _ways(time, q / speed, q_step / speed)
    if ways is None:
        return None
    fro = _to_and_fro(q / speed, ways.fast)
    if fro > _TO_AND_FRO_SHARE:
        return ClockFault(
            f"the arm goes to and fro from row to row in {fro:.0%} of the rows in motion: are rows of two "
            "recorders, or of two robots, in one file? Write one file for each"
        )
    if ways.judged.sum() < _FEWEST:
        return None
    equal = np.diff(q, axis=0).any(axis=1) == 0
    skipped = equal if left_out is None else equal | left_out
    skipped = skipped | np.append(skipped[1:], False) | np.insert(skipped[:-1], 0, False)
    judged = ways.judged
    beyond = np.where(judged, ways.way - ways.step, 0.0)
    row = _set_clock(np.where(skipped, 0.0, beyond), ways)
    if row is not None:
        return ClockFault(
            f"the time goes on by {time[row + 1] - time[row]:.3g} s while the arm moves as in one row: if the clock "
            "was set there, cut the log at this row; all is well if the arm stopped and no rows were written",
            row + 1,
            refused=False,
        )
    missing = _missing(beyond, ways) - int((judged & (beyond < -_TWICE[0])).sum())
    missing -= 0 if left_out is None else int((judged & left_out).sum())  # written too late, and then too early
    share = missing / judged.sum()
    if missing < _MISSING or share < _MISSING_SHARE or mad_sigma(beyond[judged], 0.0) > _CALM:
        return None
    return ClockFault(
        f"across {missing} steps in motion ({share:.1%}) the arm goes as far as in two: if the times count rows, rows "
        "are missing there, and the lag grows by each; record the controller's own time",
        missing_s=missing * float(np.median(ways.step_s)),
        refused=False,  # a servo that reports its angle at its own pace does the same with true times
    )


def set_back(time: Floats, q: Floats, speed: Floats) -> int | None:
    """The row, in the order of the file, at which the time [T] s goes back while the arm [T, axes] moves on.

    A recorder that writes a block late, and a second recording in the file, go on with another pose.
    """
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if len(back) != 1 or not _AROUND <= back[0] < len(steps) - _AROUND:
        return None
    row = int(back[0])
    ways = np.linalg.norm(np.diff(q[row - _AROUND : row + _AROUND + 2] / speed, axis=0), axis=1)
    usual, usual_s = float(np.median(ways)), float(np.median(np.abs(steps)))
    if -steps[row] < max(_SET_ROWS * usual_s, _SET_S):  # rows that came in another order
        return None
    if usual < _FAST * usual_s or not 1 - _TWICE[0] < ways[_AROUND] / usual < 1 + _TWICE[0]:
        return None
    return row + 1


def _ways(time: Floats, x: Floats, x_step: Floats) -> _Ways | None:
    """Steps and ways over their usual sizes around; None with too few rows in motion."""
    if len(time) < 2 * _AROUND + _FEWEST:
        return None
    step_s, way = np.diff(time), np.linalg.norm(np.diff(x, axis=0), axis=1)
    usual_s, usual = _running_median(step_s), _running_median(way)
    chord = np.linalg.norm(x[2 * _AROUND + 1 :] - x[: -2 * _AROUND - 1], axis=1) / (2 * _AROUND + 1)
    ahead = np.full(len(way), 0.0)
    ahead[_AROUND:-_AROUND] = chord
    typical_s = float(np.median(step_s))
    written = float(np.linalg.norm(x_step))
    fast = (usual > _FAST * np.maximum(usual_s, typical_s)) & (usual > _STEPS_OF_ENCODER * written)
    # where the arm starts, stops or turns there is no usual way
    even = np.abs(usual - _shifted(usual)) < 0.3 * usual
    fast &= even & (ahead > 0)
    if fast.sum() < _FEWEST:
        return None
    nan = np.full(len(way), np.nan)
    nan[fast & (ahead > _AHEAD * usual)] = 1.0
    three = np.pad(np.linalg.norm(x[3:] - x[:-3], axis=1), 1)
    usual = np.maximum(usual, 1e-12)
    return _Ways(step_s / usual_s * nan, way / usual * nan, three / usual * nan, usual_s, fast)


def _shifted(usual: Floats) -> Floats:
    """The usual way of rows `_AROUND` ahead or behind, whichever differs more."""
    padded = np.pad(usual, _AROUND, mode="edge")
    ahead, behind = padded[2 * _AROUND :], padded[: -2 * _AROUND]
    return np.where(np.abs(ahead - usual) > np.abs(behind - usual), ahead, behind)


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


def _missing(beyond: Floats, ways: _Ways) -> int:
    """Steps across which the arm covers the way of two rows, and beside which it covers that of one, onwards.

    Stamps that count rows are even; where they are not, they tell of the rows that are missing. Beside a pose of
    another time the arm goes back.
    """
    judged = ways.judged
    uneven = np.pad(judged & ~(np.abs(ways.step - 1) < _TWICE[1]), _AROUND)
    judged = judged & ~np.lib.stride_tricks.sliding_window_view(uneven, 2 * _AROUND + 1).any(axis=1)
    alone = np.pad(np.abs(np.where(judged, beyond, 0.0)) < _TWICE[1], 1, constant_values=True)
    twice = judged & (np.abs(beyond - 1) < 1 - _TWICE[0]) & alone[:-2] & alone[2:] & (ways.three > 3)
    return int(twice.sum())


def _set_clock(beyond: Floats, ways: _Ways) -> int | None:
    """The one step across which the stamps go on by rows, and the arm by one, and the next stamps do not make up.

    A recorder that writes only while the arm moves has several.
    """
    far = ways.judged & (-beyond > np.maximum(_SET_ROWS, _SET_S / ways.step_s)) & (ways.way < 2.0)
    places = np.flatnonzero(far)
    if len(places) != 1:
        return None
    row = int(places[0])
    around = float(beyond[max(row - 12, 0) : row + 13].sum() - beyond[row])
    return row if abs(around) < 0.2 * abs(beyond[row]) else None


def _to_and_fro(x: Floats, judged: NDArray[np.bool_]) -> float:
    """Share of the rows in motion at which the arm turns back: an arm that swings turns in two rows of a swing."""
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    way = steps[1:] + steps[:-1]
    distance = np.linalg.norm(x[2:] - x[:-2], axis=1)
    where = judged[1:] & judged[:-1]
    if not where.any():
        return 0.0
    return float((way[where] > _TO_AND_FRO * distance[where]).mean())


def _changes(time: Floats, moved: Floats, judged: NDArray[np.bool_]) -> float:
    """Scatter of the changes of speed, as logarithms, from step to step of the judged ones."""
    steps = np.diff(time)
    speed = np.log(np.maximum(moved, 1e-12) / np.maximum(steps, 0.01 * float(np.median(steps))))
    return _scatter(np.diff(speed)[judged[1:] & judged[:-1]])


def _scatter(values: Floats) -> float:
    """Root mean square without the farthest few: a clock that was set once makes no uneven stamps."""
    squares = np.sort(values**2)
    return float(np.sqrt(squares[: int(_TRUSTED * len(squares))].mean()))


def _running_median(values: Floats) -> Floats:
    """[T] median of nine values around each."""
    padded = np.pad(values, _AROUND, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1), axis=1))
