"""How finely a log writes its positions and times, and positions smoothed by as much as that requires.

Accelerations are second differences: at 100 rows a second, a position written to 0.001 rad leaves an acceleration that
is wrong by several rad/s^2. The regression on such a motion is weakened as by a smooth, late one, and its lag comes out
wrong. A quadratic through all rows of a window (Savitzky and Golay, Anal. Chem. 36, 1964, here for uneven times) has an
acceleration whose error falls with the fifth power of the root of the window's length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

_FINEST = 6
"""Decimals; finer steps matter to no derivative."""
_WHOLE, _WHOLE_SHARE = 0.02, 0.98
"""Of a step, by which a value may differ from whole steps, and the share of values that are whole."""
_KEPT = 0.9
"""Share of the distinct values that stay distinct once they are rounded to the step."""
_MANY = 0.3
"""Share of the values within a decade from which on their step counts."""
_FEWEST_VALUES = 3
"""Distinct values that show a step: a joint that rests at 0, or at 1 rad, shows none."""
_LEAST_VALUES, _REPEATED = 20, 3
"""Values, and rows of each, by which counts of an encoder are known: a joint at constant speed has even steps, too."""
_ERROR = 0.05
"""rad/s^2 or m/s^2, standard error of an acceleration that changes neither lag nor model."""
_SHORTEST_S, _LONGEST_S = 0.1, 0.4
"""Shorter windows change nothing; longer ones would hide the motion. (A window passes 1/window Hz.)"""
COARSE_S = 0.2
"""Windows from which on fast motion is lost: half a period at the 2.5 Hz up to which motion and power are compared."""
_AROUND = 4
"""Rows on either side that tell the usual speed."""
_EVEN, _FAST = 0.3, 0.05
"""Change of the speed over those rows, and share of the speed limits, at which rows tell the jitter of their times."""
_LEAST_JITTER = 0.07
"""Of the time between rows: less cannot be told from the motion."""
_LEAST_FOR_JITTER = 20
_CUT = 0.1
"""Jitter of times, over the step in which they are written, if that step is its cause. (Uniform: 0.29.)"""
_TRUSTED = 0.98
"""Share of the rows whose times are judged: a few others may hold poses of other times."""
_COUNTS = 0.2
_STEPS_MOVED = 3.0
"""An axis that moves less is at rest."""
_GAP_S = 0.25
"""Rows farther apart are no neighbours."""
_LEAST_ROWS = 5


def resolution(values: Floats) -> float:
    """Step between the values [T] (rad, m or s) that a log can write; 0 where no rule is seen.

    Decimals of the values, or of the degrees that they were, or counts of an encoder that repeat. Numbers of so many
    digits have wider steps where they are larger: the widest step of many values counts.
    """
    finite = values[np.isfinite(values)]
    decade = np.floor(np.log10(np.maximum(np.abs(finite), 1e-9)) + 1e-9)
    many = [finite[decade == each] for each in np.unique(decade)]
    return max((_step(some) for some in [finite, *many] if len(some) > _MANY * len(finite)), default=0.0)


def steps_of(q: Floats) -> Floats:
    """[axes] rad or m: how finely angles [T, axes] are written."""
    return np.array([resolution(angle) for angle in q.T])


def common_step(changes: Floats) -> float:
    """The least of some changes [n] > 0 if the others are whole multiples of it; else 0."""
    with np.errstate(over="ignore", invalid="ignore"):  # the least change may be one of the arithmetic
        counts = changes / changes.min()
        whole = np.abs(counts - np.rint(counts)) < _WHOLE
    return float(changes.min()) if whole.mean() > _WHOLE_SHARE else 0.0


def _step(values: Floats) -> float:
    known, rows = np.unique(values, return_counts=True)
    if len(known) < _LEAST_VALUES or np.median(rows) < _REPEATED:
        return _decimals(values)
    gaps = np.diff(known)
    usual = float(np.median(gaps))
    whole = np.abs(gaps / usual - np.rint(gaps / usual)) < _WHOLE
    return _decimals(values) or (usual if whole.mean() > _WHOLE_SHARE else 0.0)


def _decimals(values: Floats) -> float:
    """The last decimal of values, or of the degrees that they were; 0 with too many."""
    for unit in (1.0, np.pi / 180):
        distinct = len(np.unique(np.rint(values / unit * 10.0 ** (_FINEST + 1))))
        if distinct < _FEWEST_VALUES:
            continue
        for digits in range(_FINEST + 1):
            counts = values / unit * 10.0**digits
            whole = np.rint(counts)
            # a joint that rests near 0 is near a whole number of any step
            if (np.abs(counts - whole) < _WHOLE).mean() > _WHOLE_SHARE and len(np.unique(whole)) > _KEPT * distinct:
                return float(unit * 10.0**-digits)
    return 0.0


@dataclass(frozen=True, slots=True)
class Smoothing:
    """Why, and over how long, the positions of a log are smoothed."""

    windows_s: Floats
    """[axes]; 0 for an axis that is left as logged."""
    q_step: Floats
    """[axes] rad or m: how finely positions are written."""
    jitter_s: float
    """Standard deviation of the times, by their digits."""
    time_step_s: float
    """How finely times are written; 0 where this is fine enough."""
    from_times: Floats
    """[axes] variance of the positions that the jitter of the times stands for."""

    @property
    def longest_s(self) -> float:
        """The longest window."""
        return float(self.windows_s.max())

    @property
    def hides(self) -> NDArray[np.bool_]:
        """[axes] whose fast motion is lost."""
        return self.windows_s > COARSE_S

    def fails(self, step_s: float) -> NDArray[np.bool_]:
        """[axes] whose windows hide fast motion, or hold too few rows `step_s` apart to smooth anything."""
        return self.hides | ((self.windows_s > 0) & (self.windows_s < _LEAST_ROWS * step_s))

    @property
    def coarse(self) -> bool:
        """Whether fast motion is lost, so that the log cannot tell a supply's lag from the smoothing."""
        return bool(self.hides.any())

    @property
    def age_error_s(self) -> float:
        """By how much all times may be wrong together.

        Cut off, they are half a step early; where two rows have one stamp, the row that is used differs by as much.
        """
        return self.time_step_s

    def sentence(self) -> str:
        """What a user should know."""
        causes = []
        axis = int(self.windows_s.argmax())
        if self.time_step_s:
            causes.append(f"times are only written to {self.time_step_s:.3g} s, or cut off there")
        if self.q_step[axis] ** 2 / 12 > _COUNTS * float(self.from_times[axis]):
            causes.append(f"positions are only written to {self.q_step[axis]:.2g} (rad, or m where an axis slides)")
        lost = ", which hides fast motion" if self.coarse else ""
        return f"{' and '.join(causes)}: smoothed over up to {self.longest_s:.2g} s{lost}; write more digits"


def smoothing_of(time: Floats, q: Floats, q_step: Floats, speed: Floats) -> Smoothing | None:
    """The smoothing that positions [T, axes] at rising times [T] s need; None where they need none.

    `q_step` [axes]: how finely positions are written; `speed` [axes]: the speed limits. A wrong time is a wrong
    position of an axis that moves.
    """
    if len(time) < _LEAST_FOR_JITTER:
        return None
    steps = np.diff(time)
    near = steps < _GAP_S
    if not near.any():
        return None
    written = resolution(np.round(time - time[0], 7))
    jitter_s = _jitter(time, q, q_step, speed) if written else 0.0
    if not _CUT * written < jitter_s < written:  # a jitter of other causes may be the motion's own
        jitter_s = written = 0.0
    velocity = np.diff(q, axis=0)[near] / steps[near, None]
    from_times = np.mean(velocity**2, axis=0) * jitter_s**2
    moved = np.ptp(q, axis=0) > _STEPS_MOVED * q_step
    variance = q_step**2 / 12 + from_times
    # variance of the acceleration of a quadratic through rows all `step` apart: 720 variance step / window^5
    needed = (720 * variance * float(np.median(steps)) / _ERROR**2) ** 0.2
    lengths = np.where((needed > _SHORTEST_S) & moved, np.minimum(needed, _LONGEST_S), 0.0)
    if not lengths.any():
        return None
    return Smoothing(lengths, q_step, jitter_s, written, from_times)


def _jitter(time: Floats, q: Floats, q_step: Floats, speed: Floats) -> float:
    """Standard deviation [s] of the times: steps between rows against the way that was covered, at the speed around."""
    x, ends = q / speed, _AROUND
    way = np.linalg.norm(np.diff(x, axis=0), axis=1)
    middle = np.arange(ends, len(way) - ends)
    long_s = time[middle + ends + 1] - time[middle - ends]
    usual = (x[middle + ends + 1] - x[middle - ends]) / long_s[:, None]
    pace = np.linalg.norm(usual, axis=1)
    step_s = time[middle + 1] - time[middle]
    # rows that turn or start in between have no usual speed
    even = np.abs(np.array([np.linalg.norm((x[middle + k + ends] - x[middle + k]) /
                                           (time[middle + k + ends] - time[middle + k])[:, None] - usual, axis=1)
                            for k in (1, -ends)])).max(axis=0) < _EVEN * pace  # fmt: skip
    rounding = float(np.linalg.norm(q_step / speed)) / np.sqrt(6)
    fast = even & (pace > _FAST) & (long_s < _GAP_S * 2) & (pace * step_s > 4 * rounding)
    if fast.sum() < _LEAST_FOR_JITTER:
        return 0.0
    off = way[middle][fast] / pace[fast] - step_s[fast]
    trusted = np.sort(off**2)[: int(_TRUSTED * len(off))]
    variance = float(trusted.mean()) - float(np.median(rounding / pace[fast])) ** 2
    jitter_s = float(np.sqrt(max(variance, 0.0) / 2))
    return jitter_s if jitter_s > _LEAST_JITTER * float(np.median(step_s)) else 0.0


def smoothed(time: Floats, q: Floats, windows_s: Floats) -> Floats:
    """Positions [T, axes] at rising times [T] s, by the quadratic through the rows of each axis' window [axes] s.

    Rows at the ends and beside gaps have one-sided windows.
    """
    out = q.copy()
    segment = np.concatenate([[0], np.cumsum(np.diff(time) >= _GAP_S)])
    for length in np.unique(windows_s[windows_s > 0]):
        axes = np.flatnonzero(windows_s == length)
        out[:, axes] = _local_quadratic(time, q[:, axes], segment, float(length) / 2)
    return out


def _local_quadratic(time: Floats, q: Floats, segment: NDArray[np.int64], half_s: float) -> Floats:
    rows, reach = len(time), int(np.ceil(half_s / max(float(np.median(np.diff(time))), 1e-6))) + 1
    index = np.arange(rows)
    moments, right = np.zeros((rows, 5)), np.zeros((rows, 3, q.shape[1]))
    for offset in range(-reach, reach + 1):
        other = np.clip(index + offset, 0, rows - 1)
        at = (time[other] - time) / half_s
        used = (other == index + offset) & (np.abs(at) <= 1.0) & (segment[other] == segment)
        powers = np.where(used[:, None], at[:, None] ** np.arange(5), 0.0)
        moments += powers
        right += powers[:, :3, None] * (q[other] - q)[:, None, :]
    enough = moments[:, 0] >= _LEAST_ROWS
    normal = moments[:, np.add.outer(np.arange(3), np.arange(3))] + 1e-9 * np.eye(3)
    found = np.linalg.solve(normal, right)[:, 0]
    return np.asarray(q + np.where(enough[:, None], found, 0.0))
