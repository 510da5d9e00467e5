"""Angles of single joints that stay while the joint moves on: messages or registers that are not refreshed.

A joint that rests leaves slowly, because its acceleration is limited. One whose value was stale moves at once, in one
row, by what it has covered meanwhile. Joints that are all refreshed in turn, every few rows, have that as their rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import mad_sigma
from acqd.robot.doubtful_rows import CLEARLY, MOVING, RESOLUTIONS
from acqd.robot.garbled import TOO_FAST
from acqd.robot.resolution import common_step

Flags = NDArray[np.bool_]

_RUN = 3
"""Times the rows that the joint's values usually stay: fewer leave neighbours by which the angle is known."""
_FEWEST = 30
"""Changes by which the refreshing of a joint is known."""
_OFTEN = 0.2
"""Share of the changes of a moving joint before which its value stayed while others changed."""
_COUNTS = 1.5
"""Steps of the written values, below which a change is one step."""


def frozen(time: Floats, q: Floats, q_step: Floats, acceleration: Floats) -> Flags:
    """[T, axes] angles [T, axes] at rising times [T] s that repeat the last value while the joint moves on.

    `q_step` [axes]: how finely angles are written; `acceleration` [axes] rad/s^2 or m/s^2: the limits of the joints.
    Poses are judged once: a row that repeats the pose before is as that row.
    """
    stale = np.zeros(q.shape, bool)
    new = np.concatenate([[True], (q[1:] != q[:-1]).any(axis=1)])  # a fast recorder repeats what the controller says
    for axis, angle in enumerate(q[new].T):
        of_new = _frozen(time[new], angle, float(q_step[axis]), float(acceleration[axis]))
        stale[:, axis] = of_new[np.cumsum(new) - 1]
    return stale


def _frozen(time: Floats, angle: Floats, written: float, acceleration: float) -> Flags:
    stale = np.zeros(len(time), bool)
    if len(time) < 2 * _RUN:  # an arm that stands still has one pose
        return stale
    first = np.flatnonzero(np.concatenate([[True], angle[1:] != angle[:-1]]))  # of each run of equal values
    held, moved = np.diff(first), np.abs(np.diff(angle[first]))
    steps = moved[moved > 0]
    written = max(written, float(steps.min())) if len(steps) else written
    last_s = time[first[1:]] - time[first[1:] - 1]  # the step in which the joint moves at once
    noise = mad_sigma(np.diff(angle, 2), 0.0) / np.sqrt(6)
    possible = np.maximum(TOO_FAST * acceleration * last_s**2, max(RESOLUTIONS * written, CLEARLY * noise))
    long = held > _RUN * max(float(np.median(held)), 1.0) if len(held) else held > 0
    for k in np.flatnonzero(long & (moved > possible)):
        stale[first[k] + 1 : first[k + 1]] = True
    return stale


def between_refreshes(time: Floats, q: Floats, q_step: Floats, speed: Floats) -> tuple[Floats, Floats]:
    """Angles [T, axes] with straight lines between refreshed values, and how finely they are known [axes].

    For joints whose values are refreshed each by itself, every few rows or once they have changed by a deadband; the
    others stay as they are. `speed` [axes]: the speed limits; `q_step` [axes]: how finely angles are written.
    """
    if len(time) < _FEWEST or q.shape[1] < 2:
        return q, q_step
    lines, known = q.copy(), q_step.copy()
    moves = (q[1:] != q[:-1]).any(axis=1)
    for axis in range(q.shape[1]):
        found = _refreshed(time, q[:, axis], moves, float(q_step[axis]), float(speed[axis]))
        if found is not None:
            fresh, known[axis] = found
            lines[:, axis] = np.interp(time, time[fresh], q[fresh, axis])
    return lines, known


def _refreshed(
    time: Floats, angle: Floats, moves: Flags, written: float, speed: float
) -> tuple[NDArray[np.int64], float] | None:
    """Rows with new values, and the least change that made one; None unless many values of a moving joint are old.

    `moves` [T - 1]: whether any joint changes to the next row.
    """
    changed = np.flatnonzero(np.diff(angle)) + 1
    if len(changed) < _FEWEST:
        return None
    rows = np.diff(changed, prepend=0)
    stays = np.concatenate([[0], np.cumsum(moves)])  # rows in which others move do not count where all stay
    waited = np.diff(stays[changed], prepend=0) > 1
    size = np.abs(np.diff(angle))[changed - 1]
    fast = size > MOVING * speed * (time[changed] - time[changed - np.maximum(rows, 1)])
    written = max(written, common_step(size))
    stale = waited & (size > _COUNTS * written)  # one step of an encoder may take any time
    onward = np.sign(np.diff(angle)[changed - 1])
    onward = np.where(onward == np.roll(onward, 1), 1, -1)  # the noise of an encoder goes back more often than on
    if fast.sum() < _FEWEST or (stale * onward)[fast].mean() < _OFTEN:
        return None
    usual = int(np.median(rows[fast]))
    rested = changed[rows > _RUN * usual] - usual
    return np.unique(np.concatenate([[0], changed, rested, [len(time) - 1]])), float(size[stale & fast].min())
