"""Which rows of a motion can be trusted: repeated poses, and poses older or newer than their stamps.

Velocities and accelerations are differences of neighbours. A pose that is one row old changes both by their own size,
so that a few per cent of such rows shift the lag and spoil the model. A recorder leaves traces by which they are known:

- A recorder that is faster than the controller, or that misses a message, writes the last pose again. The arm then
  seems to stop for some rows and to catch up in one. An arm that really rests leaves and arrives slowly. A recorder
  that is late writes the next pose too early, and then again: the arm goes two ways in one row, and stops for one.
- A pose that was old (or new) when it was stamped lies on the path, but not where its neighbours expect it. The
  distance along the path, divided by the speed, is the pose's age.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import mad_sigma, runs_of_true
from acqd.robot.motion_quality import MotionQuality

Flags = NDArray[np.bool_]

MOVING = 0.005
"""Share of the speed limits from which on an arm moves: slower rows tell nothing, and do no harm."""
_CAUGHT_UP = 0.5
"""Speed across equal poses, over the speed around them, from which on the arm has moved meanwhile. An arm that starts
or stops there, within one row, reaches a third."""
_READ_AHEAD = 0.75
"""Rows from the first of two equal ones to the time of their pose, from which on the first is too early. Poses that
come at another rate than the rows have at most a half."""
RESOLUTIONS = 2.5
"""Steps of the encoder: a slow joint crosses one now and then, and the rows between are equal by right."""
_OLD = 0.3
"""Of the time between rows: an age that is a fault, not a jitter."""
_OLD_COARSE, _COARSE_S = 0.8, 0.02
"""The same for rows so far apart that a cubic through their neighbours misses a hard start."""
_LEAST_AGE_S = 0.002
"""Younger faults, of logs at 1 kHz, are below what rows of 40 ms show."""
CLEARLY = 6.0
"""Standard deviations of the poses' distances from the path."""
_ALONG = 0.5
"""Distance across the path, over that along the path, at which a pose is off the path and not late on it."""
_FAR_ROWS = 8.0
"""Usual rows between the outer ones of four neighbours, or between two, beyond which they say nothing of the poses
between them."""
_AROUND = 8
"""Rows before and after by which an arm arrives and leaves."""
_AGAIN_ROWS = 20
"""Rows after which a pose may be sent again."""
_AWAY = 0.3
"""Distance of the rows between from a pose that is sent again, over the usual way of a row around them: an arm that
dwells for some rows flickers there between the steps of its encoder. A pose that far from the middle of its neighbours
is not on the path."""
_PASSES = 12
_NEIGHBOURS = (-2, -1, 1, 2)
_LEAST_ROWS = 8


@dataclass(frozen=True, slots=True)
class Doubts:
    """Rows [T] of a motion whose derivatives cannot be trusted."""

    repeated: Flags
    old: Flags
    early: Flags
    moving: int
    age_s: float
    row_s: float

    @property
    def any(self) -> Flags:
        """[T] rows to leave out."""
        return self.repeated | self.old | self.early

    def quality(self) -> MotionQuality:
        """Counts of the rows."""
        repeated, old, early = (int(flags.sum()) for flags in (self.repeated, self.old, self.early))
        return MotionQuality(len(self.old), self.moving, repeated, old, early, self.age_s, self.row_s)


def doubtful_rows(time: Floats, q: Floats, speed: Floats, q_step: Floats | None = None) -> Doubts:
    """Rows of angles [T, axes] at rising times [T] s that cannot be trusted; `speed` [axes]: the speed limits.

    `q_step` [axes]: how finely angles are written (robot.resolution).
    """
    x = q / speed
    step = np.zeros(q.shape[1]) if q_step is None else q_step / speed
    repeated, early = _repeated(time, x, step)
    old, sent_early, since_s = _sent_again(time, x, step)
    early |= sent_early
    exchanged = _exchanged(x, step)
    early |= exchanged
    old[1:] |= exchanged[:-1]
    old &= ~repeated & ~early
    kept = np.flatnonzero(~repeated & ~old & ~early)
    moves = _speeds(time, x) > MOVING
    row_s = _usual_step(time[kept], moves[kept])
    written = float(np.linalg.norm(step))
    ages: list[Floats] = [since_s[old]] if old.any() else []
    if len(kept) >= _LEAST_ROWS:
        for newer, flags in ((False, old), (True, early)):
            for _ in range(_PASSES):
                wrong, age = _not_at_their_time(time[kept], x[kept], row_s, written, newer=newer)
                if not wrong.any():
                    break
                flags[kept[wrong]] = True
                ages += [] if newer else [age[wrong]]
                kept = kept[~wrong]
    moving = int((moves | repeated | old | early).sum())
    age_s = float(np.median(np.concatenate(ages))) if ages else 0.0
    return Doubts(repeated, old, early, moving, age_s, row_s)


def _usual_step(time: Floats, moves: Flags) -> float:
    """Median time [s] between rows in motion; between all rows where the arm rests."""
    steps = np.diff(time)
    if not len(steps):
        return 0.0
    return float(np.median(steps[moves[1:]] if moves[1:].any() else steps))


def _speeds(time: Floats, x: Floats) -> Floats:
    """[T] share of the speed limits, by the neighbours of each row; equal poses in motion count as moving."""
    if len(time) < 3:
        return np.zeros(len(time))
    wide = min(4, (len(time) - 1) // 2)  # across some equal poses
    index = np.arange(len(time))
    before, after = np.maximum(index - wide, 0), np.minimum(index + wide, len(time) - 1)
    return np.asarray(np.linalg.norm(x[after] - x[before], axis=1) / (time[after] - time[before]))


def _repeated(time: Floats, x: Floats, step: Floats) -> tuple[Flags, Flags]:
    """[T] rows that repeat the row before although the arm moved meanwhile, and rows before the row of their pose."""
    equal = np.concatenate([[False], (x[1:] == x[:-1]).all(axis=1)])
    repeated, early = np.zeros(len(time), bool), np.zeros(len(time), bool)
    first = np.flatnonzero(~equal)  # of each run of equal poses
    if len(first) == len(time) or len(first) < 3:
        return repeated, early
    moved = np.diff(x[first], axis=0)
    speed = moved / np.diff(time[first])[:, None]
    before, after = np.vstack([speed[1:2], speed[:-1]]), np.vstack([speed[1:], speed[-2:-1]])
    around = np.linalg.norm(before + after, axis=1) / 2
    across = np.linalg.norm(speed, axis=1)
    steps = np.abs(moved)
    resolution = np.where(steps > 0, steps, np.inf).min(axis=0)
    finite = np.maximum(np.where(np.isfinite(resolution), resolution, 0.0), step)
    clear = (across > MOVING) & (steps > RESOLUTIONS * finite).any(axis=1)
    # beyond a pause of the recorder, the arm may have left a rest slowly
    next_s = time[first[1:]] - time[first[1:] - 1]
    held = (np.diff(first) > 1) & (next_s < _FAR_ROWS * float(np.median(np.diff(time))))
    ahead = _ahead(time, x, first) & held & clear & np.concatenate([[False], clear[:-1]])
    early[first[:-1][ahead]] = True
    caught_up = np.flatnonzero(clear & held & (across >= _CAUGHT_UP * around) & ~ahead)
    for start, end in zip(first[caught_up] + 1, first[caught_up + 1], strict=True):
        repeated[start:end] = True
    return repeated, early


def _ahead(time: Floats, x: Floats, first: NDArray[np.int64]) -> Flags:
    """[n - 1] poses in two equal rows, the first of them at rows `first` [n], that are those of the second row.

    The ways from the pose before and to the next one, at the speed of both together, tell the time of the pose.
    """
    span, way = np.diff(time[first]), np.linalg.norm(np.diff(x[first], axis=0), axis=1)
    speed = np.pad(way / span, 1, mode="edge")
    ahead = np.zeros(len(span), bool)
    across = (way[:-1] + way[1:]) / (span[:-1] + span[1:])
    around = (speed[:-3] + speed[3:]) / 2
    after_s = way[:-1] / np.maximum(across, 1e-12) - span[:-1]
    row_s = time[first[1:-1] + 1] - time[first[1:-1]]
    ahead[1:] = (np.diff(first)[1:] == 2) & (across >= _CAUGHT_UP * around) & (after_s > _READ_AHEAD * row_s)
    return ahead


def _exchanged(x: Floats, step: Floats) -> Flags:
    """[T] rows that hold the pose of the next row, which holds theirs: messages that overtake each other.

    Of the ways between the rows around, each of the two is nearer to the place of the other.
    """
    exchanged = np.zeros(len(x), bool)
    if len(x) < _LEAST_ROWS:
        return exchanged
    third = (x[3:] - x[:-3]) / 3
    places = x[:-3] + third, x[:-3] + 2 * third
    crossed = [np.linalg.norm(x[1 + k : len(x) - 2 + k] - places[1 - k], axis=1) for k in (0, 1)]
    way = np.linalg.norm(third, axis=1)
    noise = mad_sigma(np.linalg.norm(np.diff(x, 2, axis=0), axis=1), 0.0) / np.sqrt(6)
    clear = way > max(RESOLUTIONS * float(np.linalg.norm(step)), CLEARLY * noise)
    exchanged[1:-2] = clear & (np.maximum(*crossed) < way / 2)
    return exchanged


def _sent_again(time: Floats, x: Floats, step: Floats) -> tuple[Flags, Flags, Floats]:
    """[T] rows with the pose of an earlier row, not that before, rows with that of a later one, and the ages [T] s.

    Of two rows with one pose between which the arm moved on, the one that is farther from its neighbours is wrong.
    """
    again, too_early, age = np.zeros(len(time), bool), np.zeros(len(time), bool), np.zeros(len(time))
    if len(time) < _LEAST_ROWS:
        return again, too_early, age
    _, first, inverse = np.unique(x, axis=0, return_index=True, return_inverse=True)
    inverse = inverse.reshape(-1)
    if len(first) == len(x):
        return again, too_early, age
    order = np.lexsort((np.arange(len(x)), inverse))
    same = inverse[order[1:]] == inverse[order[:-1]]
    rows, before = order[1:][same], order[:-1][same]
    gap = rows - before
    near = (gap > 1) & (gap <= _AGAIN_ROWS)
    rows, before = rows[near], before[near]
    rows, before = _not_in_cycles(rows, before)
    if not len(rows):
        return again, too_early, age
    # an arm that goes back over its own path comes from the other side, and one that rests does not arrive and leave
    start, end = np.maximum(before - _AROUND, 0), np.minimum(rows + _AROUND, len(x) - 1)
    arrives, leaves = x[before] - x[start], x[end] - x[rows]
    fast = [
        np.linalg.norm(way, axis=1) > np.maximum(MOVING * span, RESOLUTIONS * float(np.linalg.norm(step)))
        for way, span in ((arrives, time[before] - time[start]), (leaves, time[end] - time[rows]))
    ]
    way = np.linalg.norm(arrives, axis=1) / np.maximum(before - start, 1)
    least = np.maximum(_AWAY * way, RESOLUTIONS * float(np.linalg.norm(step)))
    away = np.array([np.linalg.norm(x[a:b] - x[a], axis=1).max() for a, b in zip(before, rows, strict=True)])
    where = fast[0] & fast[1] & ((arrives * leaves).sum(axis=1) > 0) & (away > least)
    rows, before, way = rows[where], before[where], way[where]
    bent = np.pad(np.linalg.norm(x[2:] - 2 * x[1:-1] + x[:-2], axis=1), 1)
    twice = np.bincount(inverse)[inverse[rows]] == 2  # a pose that is sent again and again was there first
    ahead = twice & (bent[before] > bent[rows]) & (bent[rows] / 2 < _AWAY * way)
    too_early[before[ahead]] = True
    rows, before = rows[~ahead], before[~ahead]
    again[rows] = True
    age[rows] = time[rows] - time[before]
    return again, too_early, age


def _not_in_cycles(rows: NDArray[np.int64], before: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and earlier rows of the same pose without those of a motion that repeats every few rows."""
    order = np.argsort(rows)
    rows, before = rows[order], before[order]
    other = (np.diff(rows) != 1) | (np.diff(before) != 1)
    run = np.concatenate([[0], np.cumsum(other)])[: len(rows)]
    few = np.bincount(run)[run] < _AROUND if len(rows) else np.zeros(0, bool)
    return rows[few], before[few]


def _not_at_their_time(time: Floats, x: Floats, row_s: float, written: float, *, newer: bool) -> tuple[Flags, Floats]:
    """[T] rows whose pose is older (or newer) than their stamp, the worst of any five, and the age of all [T] s.

    The pose is compared with the cubic through two neighbours on either side. `written`: the step in which poses are
    written.
    """
    wrong, ages = np.zeros(len(time), bool), np.zeros(len(time))
    if len(time) < _LEAST_ROWS:
        return wrong, ages
    middle = np.arange(2, len(time) - 2)
    stamps = [time[middle + k] - time[middle] for k in _NEIGHBOURS]
    poses = [x[middle + k] for k in _NEIGHBOURS]
    expected = np.zeros_like(poses[0])
    for one, pose in enumerate(poses):
        others = [stamps[k] for k in range(4) if k != one]
        weight = np.prod([other / (other - stamps[one]) for other in others], axis=0)
        expected += weight[:, None] * pose
    steps = np.diff(x, axis=0) / np.diff(time)[:, None]
    nearby = np.array([steps[np.clip(middle + k, 0, len(steps) - 1)] for k in range(-3, 3)])
    slope = np.median(nearby, axis=0)  # one wrong pose must not turn the direction of the motion
    speed = np.linalg.norm(slope, axis=1)
    direction = slope / np.maximum(speed, 1e-12)[:, None]
    fast = np.partition(np.linalg.norm(nearby, axis=2), -2, axis=0)[-2]  # one wrong pose makes one step too fast
    off = x[middle] - expected
    along = (off * direction).sum(axis=1)
    across = np.linalg.norm(off - along[:, None] * direction, axis=1)
    judged = (speed > MOVING) & (stamps[3] - stamps[0] < _FAR_ROWS * row_s)
    if not judged.any():
        return wrong, ages
    age = -along / np.maximum(speed, MOVING)
    noise = mad_sigma(along[judged], 0.0)
    old = _OLD if row_s < _COARSE_S else _OLD_COARSE
    jitter = CLEARLY * mad_sigma(age[judged], 0.0)
    noise = max(noise, written / np.sqrt(12))
    # a slow joint whose angle is noisy, by its speed limit, needs more where it moves alone
    of_axes = np.array([mad_sigma(column, 0.0) for column in off[judged].T])
    noise = np.maximum(noise, np.linalg.norm(direction * of_axes, axis=1))
    limit = np.maximum(max(old * row_s, _LEAST_AGE_S, jitter), CLEARLY * noise / np.maximum(speed, MOVING))
    late = -age if newer else age
    bad = judged & (late > limit) & (np.abs(along) > old * row_s * fast) & (across < _ALONG * np.abs(along))
    height = np.where(bad, late, 0.0)
    padded = np.pad(height, 2)
    worst = np.max([padded[k : k + len(height)] for k in range(5)], axis=0)
    wrong[middle], ages[middle] = bad & (height == worst), age
    return wrong, ages


def bridged(time: Floats, values: Floats, doubts: Flags, longest_s: float) -> tuple[Floats, Flags]:
    """Values [T, k] with doubtful rows [T] replaced by the cubic through their neighbours, and rows [T] left unknown.

    A run of doubtful rows between known ones that are more than `longest_s` apart stays unknown.
    """
    known = np.flatnonzero(~doubts)
    filled, unknown = values.copy(), np.zeros(len(time), bool)
    if len(known) < 4:
        return filled, doubts.copy()
    for start, end in runs_of_true(doubts):
        if start == 0 or end == len(time) or time[end] - time[start - 1] > longest_s:
            unknown[start:end] = True
            continue
        at = int(np.searchsorted(known, start))
        around = known[max(0, min(at - 2, len(known) - 4)) :][:4]
        for row in range(start, end):
            filled[row] = _lagrange(time[around] - time[row]) @ values[around]
    return filled, unknown


def _lagrange(at: Floats) -> Floats:
    """[n] weights of values at places [n], whose sum is the value at 0 of the polynomial through them."""
    return np.array([np.prod([other / (other - own) for j, other in enumerate(at) if j != k])
                     for k, own in enumerate(at)])  # fmt: skip
