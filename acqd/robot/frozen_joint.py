"""Angles of single joints that stay while the joint moves on: a message or register that was not refreshed.

A joint that rests leaves slowly, because its acceleration is limited. One whose value was stale moves at once, in one
row, by what it has covered meanwhile. Joints that are all refreshed in turn, every few rows, have that as their rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

Flags = NDArray[np.bool_]

_RUN = 3
"""Times the rows that the joint's values usually stay: fewer leave neighbours by which the angle is known."""
_TOO_FAST = 3.0
"""Times the described acceleration, which programs keep to and stops exceed."""
_RESOLUTIONS = 2.5
"""Steps of the written values that a slow joint may cross from one row to the next."""


def frozen(time: Floats, q: Floats, q_step: Floats, acceleration: Floats) -> Flags:
    """[T, axes] angles [T, axes] at rising times [T] s that repeat the last value while the joint moves on.

    `q_step` [axes]: how finely angles are written; `acceleration` [axes] rad/s^2 or m/s^2: the limits of the joints.
    Rows in which all joints stay are repeated poses, and no fault of one joint.
    """
    stale = np.zeros(q.shape, bool)
    if len(time) < 2 * _RUN:
        return stale
    for axis, angle in enumerate(q.T):
        stale[:, axis] = _frozen(time, angle, float(q_step[axis]), float(acceleration[axis]))
    stale[1:] &= (q[1:] != q[:-1]).any(axis=1)[:, None]
    return stale


def _frozen(time: Floats, angle: Floats, written: float, acceleration: float) -> Flags:
    stale = np.zeros(len(time), bool)
    first = np.flatnonzero(np.concatenate([[True], angle[1:] != angle[:-1]]))  # of each run of equal values
    held, moved = np.diff(first), np.abs(np.diff(angle[first]))
    steps = moved[moved > 0]
    written = max(written, float(steps.min())) if len(steps) else written
    last_s = time[first[1:]] - time[first[1:] - 1]  # the row in which the joint moves at once
    possible = np.maximum(_TOO_FAST * acceleration * last_s**2, _RESOLUTIONS * written)
    long = held > _RUN * max(float(np.median(held)), 1.0) if len(held) else held > 0
    for k in np.flatnonzero(long & (moved > possible)):
        stale[first[k] + 1 : first[k + 1]] = True
    return stale
