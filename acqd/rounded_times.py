"""Times with too few digits: rows that share a stamp are put at even distances where their rate is regular.

A logger that writes 100 rows a second with one decimal gives ten rows each stamp. Which came first is known from
their order, and how far apart they are from their number: a line of time over row number goes through the stamps. It
bends, for the rate of a controller drifts. Whether the logger cut the digits off or rounded them is only seen where the
number of digits changes within the rows; otherwise all rows together may be early or late by a quarter of a stamp's
width. Rows that come at the same places of each stamp leave half a row more in doubt. Stamps whose width is no power of
ten or two are not those of missing digits: a clock ticks so, and the rows follow their stamp, or they came in packets
that were stamped last, and precede it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.numerics import running_line

_FEW = 0.005
"""Share of rows with another row's stamp up to which they are single faults, not digits that are missing."""
_APART = 2.5
"""Rows by which the time between two stamps may differ from that of the rows that hold the first."""
_IRREGULAR = 0.02
"""Share of stamps that may be off the line."""
_REACH_S, _LEAST_REACH, _REACH = 0.8, 2, 8
"""Span on either side through which the line goes, and its least and largest number of stamps. A rate drifts by less
than a row in it."""
_DRIFTS = 1.5
"""Spread of the stamps around a straight line, in rows, from which on the rate drifts; one row at an even rate."""
_CLEAR = 0.125
"""Distance from cut or rounded digits, over the width of the stamps, within which rows with more digits decide."""
_LEAST_STAMPS = 4
_POWER = 0.004
"""Distance of a logarithm from a whole number, within which a width is a power of the base: one per cent of ten."""
_WINDOW = 25
"""Stamps on either side by which a change of the number of rows per stamp is seen."""


@dataclass(frozen=True, slots=True)
class Rebuilt:
    """Times of rows whose stamps have too few digits."""

    time: Floats
    """[T] s, rising."""
    shared: int
    """Rows that had the stamp of the row before."""
    row_s: float
    """Time between rows."""
    stamp_s: float
    """Width of the widest stamps."""
    wander_s: float = 0.0
    """Distance of 95 % of the stamps from the line, beyond a row: the rate is not quite even."""
    phase_s: float = 0.0
    """How far the first row of a stamp may be from the middle of the row that it may begin in."""
    rounded: bool | None = None
    """Whether the logger rounded the times, or cut their digits off; None: the rows do not tell."""

    @property
    def by_digits(self) -> bool:
        """Whether missing digits, decimal or binary, make stamps of this width."""
        if self.stamp_s <= 0.0:
            return True
        return any(abs(power - np.rint(power)) < _POWER for power in (np.log10(self.stamp_s), np.log2(self.stamp_s)))

    @property
    def error_s(self) -> float:
        """By how much all times may be wrong together: rounded or cut off, or stamped before or after the rows."""
        unknown_s = 0.0 if self.rounded is not None else self.stamp_s / (4 if self.by_digits else 2)
        return unknown_s + self.wander_s + self.phase_s

    def sentence(self) -> str:
        """What a user should know."""
        if self.by_digits:
            cause, remedy = f"times are only written to {self.stamp_s:.3g} s", "write times with three decimals or more"
        else:
            cause = f"a stamp comes about every {self.stamp_s:.3g} s, of a slow clock or of rows in packets"
            remedy = "record the controller's own time"
        return (
            f"{self.shared} of {len(self.time)} rows have the time of the row before: {cause}. "
            f"The rows were put {1000 * self.row_s:.4g} ms apart, as their number says, and may "
            f"all be off by {1000 * self.error_s:.0f} ms; {remedy}"
        )


def shared_stamps(time: Floats, different: np.ndarray) -> int:
    """Rows of `time` [T] with the stamp of the row before but `different` [T - 1] values; 0 if they are few."""
    count = int(((np.diff(time) == 0.0) & different).sum())
    return count if count > _FEW * len(time) else 0


def rebuilt_times(time: Floats, shared: int) -> Rebuilt | None:
    """Times [T] s of rows in the order in which they were written; None where their rate is not regular."""
    if (np.diff(time) < 0.0).any():
        return None
    first = np.flatnonzero(np.concatenate([[True], np.diff(time) > 0.0]))  # row of each stamp
    if len(first) < _LEAST_STAMPS:
        return None
    rows, width = np.diff(first), np.diff(time[first])
    row_s = _row_time(rows, width)
    # the first stamp of a recording is often begun in its middle: few rows and no gap
    gap = width > np.maximum(rows * row_s, _running_median(width)) + _APART * row_s
    level = np.rint(np.log2(_running_median(rows.astype(np.float64))))
    ends = np.flatnonzero(gap | (np.diff(level, append=level[-1]) != 0)) + 1
    # the first stamp with fewer digits is begun in its middle too: it belongs to those behind it
    short = np.diff(ends, prepend=0) < _LEAST_STAMPS
    ends = ends[gap[ends - 1] | ~short | (np.append(0, ends[:-1]) == 0)]
    lines: list[_Line] = []
    for start, end in zip([0, *ends.tolist()], [*ends.tolist(), len(first)], strict=True):
        at, stamps = first[start:end], time[first[start:end]]
        last = first[end] if end < len(first) else len(time)
        usual = float(np.median(rows[start:end])) if start < len(rows) else 1.0
        joined = start > 0 and not gap[start - 1]
        if usual > 1 and len(at) > 1:
            at, stamps = at[1:], stamps[1:]  # the first rows may have begun anywhere within their stamp
        wide_s = float(np.median(width[start:end])) if usual > 1 else 0.0
        lines.append(_line(np.arange(first[start], last), at, stamps, usual, row_s, wide_s, joined=bool(joined)))
    off_s = np.concatenate([line.off for line in lines])
    if (np.abs(off_s) > _APART * row_s).mean() > _IRREGULAR:
        return None
    wander_s = max(float(np.percentile(np.abs(off_s), 95)) - row_s, 0.0)
    widest = max(lines, key=lambda line: line.wide_s)
    phase_s = (row_s - float(np.ptp(np.percentile(widest.off, [5, 95]))) / 0.9) / 2 if widest.wide_s else 0.0
    rebuilt = Rebuilt(time, shared, row_s, widest.wide_s, wander_s, max(phase_s, 0.0), _rounded(lines))
    share = {None: 0.25 if rebuilt.by_digits else 0.5, True: 0.5, False: 0.0}[rebuilt.rounded]
    times = np.concatenate([line.times - share * line.wide_s for line in lines])
    return replace(rebuilt, time=np.maximum.accumulate(times + 1e-9 * np.arange(len(times))))


@dataclass(frozen=True, slots=True)
class _Line:
    """Rows of one number of digits without a gap."""

    times: Floats
    """[rows] s, as if the digits had been cut off."""
    off: Floats
    """[stamps] s: distance of the stamps from the line."""
    wide_s: float
    """Width of the stamps; 0 where each row has its own."""
    joined: bool
    """Whether the rows go on from those before without a gap."""


def _line(
    rows: np.ndarray, at: np.ndarray, stamps: Floats, usual: float, row_s: float, wide_s: float, *, joined: bool
) -> _Line:
    """Times of `rows` by the line through `stamps` [s] of the rows `at`; `usual` rows have one stamp."""
    reach = int(np.clip(round(_REACH_S / wide_s), _LEAST_REACH, _REACH)) if wide_s else _REACH
    if len(at) < _LEAST_STAMPS:
        points = row_s * (at - at[0]) + np.mean(stamps - row_s * (at - at[0]))
        first_s = last_s = row_s
    else:
        slope, start_s = np.polyfit(at - at[0], stamps - stamps[0], 1)
        points = stamps[0] + start_s + slope * (at - at[0])
        if np.ptp(np.percentile(stamps - points, [5, 95])) > _DRIFTS * row_s:
            points = running_line(stamps, at.astype(np.float64), round(reach * usual), row_s)
        slopes = np.diff(points) / np.diff(at)
        first_s, last_s = float(slopes[:reach].mean()), float(slopes[-reach:].mean())
    times = np.interp(rows, at, points)
    times += first_s * np.minimum(rows - at[0], 0) + last_s * np.maximum(rows - at[-1], 0)
    # cut off, the first row of a stamp is half a row behind the stamp; rounded, half a stamp before that
    return _Line(times + (row_s / 2 if wide_s else 0.0), stamps - points, wide_s, joined)


def _rounded(lines: list[_Line]) -> bool | None:
    """Whether times were rounded or cut off, by rows that go on with fewer digits; None where none tell clearly."""
    votes = []
    for before, after in itertools.pairwise(lines):
        fine, coarse = (before, after) if before.wide_s < after.wide_s else (after, before)
        if not after.joined or 2 * fine.wide_s > coarse.wide_s or min(len(before.off), len(after.off)) < _REACH:
            continue
        step_s = float(np.median(np.diff(after.times[: len(after.times) // 2 + 2])))
        late = float(after.times[0] - before.times[-1] - step_s) * (1 if coarse is after else -1)
        share = late / (coarse.wide_s - fine.wide_s) if fine.wide_s else late / coarse.wide_s
        if min(abs(share), abs(share - 0.5)) > _CLEAR:
            return None
        votes.append(share > 0.25)
    return votes[0] if votes and len(set(votes)) == 1 else None


def _row_time(rows: np.ndarray, width: Floats) -> float:
    """Time between rows [s], from stamps without a gap behind them."""
    row_s = float(np.median(width / rows))
    for _ in range(3):
        whole = np.abs(width - rows * row_s) <= _APART * row_s
        if not whole.any():
            break
        row_s = float(width[whole].sum() / rows[whole].sum())
    return row_s


def _running_median(values: Floats) -> Floats:
    padded = np.pad(values, _WINDOW, mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _WINDOW + 1)
    blocks = [np.median(windows[k : k + 10_000], axis=1) for k in range(0, len(windows), 10_000)]
    return np.concatenate(blocks)
