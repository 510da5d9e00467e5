"""What values of power say about the meter: "not measured" written as a number, values that are repeated, wrong units.

A meter that has no value writes 0, -1, 9999 or the largest integer; such a number stands alone, far below or above all
others, and always is the same. A meter that is asked more often than it has new values repeats the last one; software
that puts its rows on a finer grid joins them by straight lines.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import runs_of_true
from acqd.robot.description import RobotDescription

_LEAST_ROWS = 3
_MOST_SHARE = 0.1
"""Share of the rows that may hold the number of no value."""
_LONGEST = 5
"""Rows of one value in turn, beyond which the robot may have been off."""
_FAR = 5.0
"""Distance to the nearest other value, over the usual change between unequal rows, of a number that is no value."""
_ABOVE = 2.0
"""Such a number above all others, over the next one below."""
_OFTEN = 10.0
"""Times that the largest value comes as often as any other, where a range ends."""
_LOW = 0.1
"""Share of the values that are as low as those before a number of no value, where the power falls and ends at 0."""
_STEPS = 3.0
"""Steps of the written power, beyond which a change is no rounding."""
_FEWEST_CHANGES = 30
_HELD = 0.7
"""Share of the changes that are followed by the same value at least once, and of the runs of the usual length."""
_STRAIGHT_STEPS, _STRAIGHT_SHARE = 2.5, 1e-6
"""Steps of the written power, and share of its range, up to which three values in turn are on a straight line."""
_STRAIGHT = 0.95
"""Share of the corners of one or two rows, and of those at the usual distance, from which on the rows between were
made."""
_IN_TURN = 0.95
"""Share of the changes that are followed by one of the other sign, where two meters took turns. (Noise: 0.67.)"""
_SAMPLE_ROWS = 200_000
_MOST_OF_RATED = 5.0
"""Median power over that of all joints at their rated efforts and speeds."""
_ELECTRONICS_W = 500.0


def no_values(P: Floats) -> tuple[NDArray[np.bool_], float] | None:
    """Rows [T] that hold a number where nothing was measured, and that number; None without such rows."""
    known = np.flatnonzero(np.isfinite(P))
    if len(known) < 10 * _LEAST_ROWS:
        return None
    values = P[known]
    distinct = np.unique(values)
    if len(distinct) < 3:
        return None
    changes = np.abs(np.diff(values))
    usual = float(np.median(changes[changes > 0]))
    lowest, highest = distinct[0] <= 0, distinct[-1] > _ABOVE * distinct[-2]  # idle power is neither
    for place, gap in (
        *([(0, distinct[1] - distinct[0])] if lowest else []),
        *([(len(distinct) - 1, distinct[-1] - distinct[-2])] if highest else []),
    ):
        same = values == distinct[place]
        # the only power below 0 is no value of a meter that knows no negative power
        far_W = usual if place == 0 and distinct[0] < 0 < distinct[1] else _FAR * usual
        if not _LEAST_ROWS <= same.sum() <= _MOST_SHARE * len(values) or gap <= far_W:
            continue
        runs = runs_of_true(same)
        before = [values[start - 1] for start, _ in runs if start]
        if place == 0 and before and np.median(before) < np.quantile(values[~same], _LOW):
            continue  # power goes down to 0 there: the meter knows no negative power
        jumps = [abs(values[start] - values[start - 1]) for start, _ in runs if start]
        alone = max(end - start for start, end in runs) <= _LONGEST
        if alone and len(jumps) >= _LEAST_ROWS and float(np.median(jumps)) > far_W:
            rows = np.zeros(len(P), bool)
            rows[known[same]] = True
            return rows, float(distinct[place])
    return None


def range_note(P: Floats) -> str:
    """A line on power that stops at a largest value, as at the end of a meter's range; empty otherwise."""
    values = P[np.isfinite(P)][:_SAMPLE_ROWS]
    if not len(values):
        return ""
    distinct, counts = np.unique(values, return_counts=True)
    if counts[-1] <= _OFTEN * float(counts[:-1].max(initial=1)):
        return ""
    return (
        f"P never is above {distinct[-1]:g} W, and is that in {counts[-1]} of {len(values)} rows: it may end there "
        "because the meter's range ends; choose a wider range"
    )


def two_meters_note(P: Floats) -> str:
    """A line on power that jumps up and down from row to row, as that of two meters in one file; empty otherwise."""
    values = P[np.isfinite(P)][:_SAMPLE_ROWS]
    changes = np.diff(values)
    if len(changes) < _FEWEST_CHANGES or (changes[1:] * changes[:-1] < 0).mean() < _IN_TURN:
        return ""
    return (
        f"every other row is above both of its neighbours, by {float(np.median(np.abs(changes))):.3g} W: are these "
        "rows of two meters? Give the rows of one, or a column device and --device"
    )


def no_value_note(count: int, rows: int, value: float) -> str:
    """What a user should know of rows without a value."""
    return f"{count} of {rows} rows hold {value:g} W, far from all others: they count as not measured"


def refreshed_every(P: Floats) -> int:
    """Rows after which a meter has a new value; 1 if each row has its own."""
    known = P[np.isfinite(P)][:_SAMPLE_ROWS]
    changed = np.flatnonzero(np.diff(known) != 0)
    if len(changed) < _FEWEST_CHANGES:
        return 1
    sizes = np.abs(np.diff(known)[changed])
    step = float(sizes.min())
    clear = sizes > _STEPS * step
    runs = np.diff(changed)
    after = runs[clear[:-1] & clear[1:]]  # rows from a clear change to the next
    if len(after) < _FEWEST_CHANGES or (after > 1).mean() < _HELD:
        return 1
    usual = (runs > 1) & (np.abs(runs - np.median(after)) <= 1)  # a robot on a plateau lets small changes be seen
    if usual.mean() < _HELD or len(np.unique(known[changed + 1])) < _FEWEST_CHANGES:
        return 1
    return max(round(float(np.mean(after))), 2)


def interpolated_every(P: Floats) -> int:
    """Rows between measured ones where the others lie on straight lines between these; 1 if each row was measured."""
    known = P[np.isfinite(P)][:_SAMPLE_ROWS]
    distinct = np.unique(known)
    if len(distinct) < _FEWEST_CHANGES:
        return 1
    straight_W = max(_STRAIGHT_STEPS * float(np.diff(distinct).min()), _STRAIGHT_SHARE * float(np.ptp(distinct)))
    bend = np.abs(np.diff(known, 2))
    corners = runs_of_true(bend > straight_W)
    if len(corners) <= _FEWEST_CHANGES:
        return 1
    # a measured value that lies between two rows bends both
    narrow = np.array([end - start <= 2 for start, end in corners])
    apart = np.diff([start for start, _ in corners])
    if narrow.mean() < _STRAIGHT:
        return 1
    usual = float(np.median(apart))
    return round(float(np.mean(apart[apart < 1.5 * usual]))) if usual >= 3 and _regular(apart, usual) else 1


def _regular(apart: NDArray[np.int64], usual: float) -> bool:
    """Whether distances in rows are the usual one, or twice that where a corner is too small to be seen."""
    off = np.minimum(np.abs(apart - usual), np.abs(apart - 2 * usual) / 2)
    return bool((off <= 1).mean() >= _STRAIGHT)


def large_power(P: Floats, robot: RobotDescription) -> str:
    """A line on power that no such robot can take; empty if it can."""
    known = P[np.isfinite(P)]
    rated_W = float((np.array([joint.effort for joint in robot.joint]) * robot.speed).sum()) + _ELECTRONICS_W
    usual_W = float(np.median(known)) if len(known) else 0.0
    if usual_W <= _MOST_OF_RATED * rated_W:
        return ""
    return (
        f"the power is {usual_W:.3g} W in the median, and all joints of {robot.name} together are rated at "
        f"{rated_W:.3g} W: is it in mW? expected W"
    )
