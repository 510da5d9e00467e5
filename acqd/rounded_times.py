"""Times with too few digits: rows that share a stamp are put at even distances where their rate is regular.

A logger that writes 100 rows a second with one decimal gives ten rows each stamp. Which came first is known from
their order, and how far apart they are from their number: a straight line of time over row number goes through the
stamps. Whether the logger cut the digits off or rounded them is not known, so that all rows together may be early or
late by a quarter of a stamp's width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

_FEW = 0.005
"""Share of rows with another row's stamp up to which they are single faults, not digits that are missing."""
_APART = 2.5
"""Rows by which the time between two stamps may differ from that of the rows that hold the first."""
_WIDER = 1.5
"""Usual time between stamps beyond which rows are missing."""
_IRREGULAR = 0.02
"""Share of stamps that may be off the line."""
_LEAST_STAMPS = 4
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

    @property
    def error_s(self) -> float:
        """By how much all times may be wrong together: the logger may have rounded or cut off."""
        return self.stamp_s / 4 + self.wander_s

    def sentence(self) -> str:
        """What a user should know."""
        return (
            f"{self.shared} of {len(self.time)} rows have the time of the row before: times are only written to "
            f"{self.stamp_s:.3g} s. The rows were put {1000 * self.row_s:.4g} ms apart, as their number says, and may "
            f"all be off by {1000 * self.error_s:.0f} ms; write times with three decimals or more"
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
    gap = (width > (rows + _APART) * row_s) & (width > _WIDER * _running_median(width))
    level = np.rint(np.log2(_running_median(rows.astype(np.float64))))
    ends = np.flatnonzero(gap | (np.diff(level, append=level[-1]) != 0)) + 1
    times = np.empty(len(time))
    distances: list[Floats] = []
    stamp_s = 0.0
    for start, end in zip([0, *ends.tolist()], [*ends.tolist(), len(first)], strict=True):
        at, stamps = first[start:end], time[first[start:end]]
        last = first[end] if end < len(first) else len(time)
        numbers = np.arange(at[0], last)
        usual = float(np.median(rows[start:end])) if start < len(rows) else 1.0
        slope = row_s
        if usual > 1 and len(at) > 1 and (start == 0 or gap[start - 1]):
            at, stamps = at[1:], stamps[1:]  # the first rows may have begun anywhere within their stamp
        if len(at) >= _LEAST_STAMPS:
            fitted = float(np.polyfit(at - at[0], stamps - stamps[0], 1)[0])
            slope = fitted if abs(fitted / row_s - 1) < 0.2 else row_s
        line = float(np.mean(stamps - slope * at))
        wide_s = float(np.median(width[start:end])) if usual > 1 else 0.0
        distances.append(np.abs(stamps - line - slope * at) / slope)
        # cut off, the first row of a stamp is half a row behind the stamp; rounded, half a stamp before that
        times[numbers] = line + slope * numbers + (slope / 2 - wide_s / 4 if wide_s else 0.0)
        stamp_s = max(stamp_s, wide_s)
    rows_off = np.concatenate(distances)
    if (rows_off > max(_APART, stamp_s / row_s / 2)).mean() > _IRREGULAR:
        return None
    wander_s = max(float(np.percentile(rows_off, 95)) - 1.0, 0.0) * row_s
    return Rebuilt(np.maximum.accumulate(times + 1e-9 * np.arange(len(times))), shared, row_s, stamp_s, wander_s)


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
