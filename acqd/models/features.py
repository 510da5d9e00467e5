"""Velocity and acceleration of sampled joint angles (thesis Eq. 7.16, 7.17)."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats

_RESTS = 1e-3
"""rad or m from row to row, up to which a joint rests at an end of a recording: rounding and noise of the encoder."""
_STEADY_ROWS = 3
"""Rows beyond an end over which the acceleration stays; in the rows behind, the joint comes to rest."""
_FADES = 0.5
"""Share of the speed that remains from one of those rows to the next: nobody knows how the motion goes on."""


def padded(q: Floats, radius: int) -> Floats:
    """Angles [T, axes] with both ends repeated `radius` times: [T + 2 radius, axes]."""
    return np.concatenate([np.repeat(q[:1], radius, axis=0), q, np.repeat(q[-1:], radius, axis=0)])


def continued(q: Floats, radius: int) -> Floats:
    """As `padded`, of a recording that may begin and end in motion.

    A joint that moves at an end goes on with the acceleration of the last three rows, so that the derivatives there are
    one-sided differences. (The jerk of four rows would treble the noise of the acceleration.)
    """
    return np.concatenate([_beyond(q[2::-1], radius)[::-1], q, _beyond(q[-3:], radius)])


def lead_in(q: Floats) -> Floats:
    """Rows [k, axes] before angles [T, axes] that begin in motion; none before a rest.

    A model with a memory, such as a supply's lag, needs them to begin in the state that the motion has left.
    """
    rows = _STEADY_ROWS - 1  # the derivative of the first of them needs one more
    return continued(q, rows)[:rows] if len(q) > 1 and np.abs(q[1] - q[0]).max() > _RESTS else q[:0]


def _beyond(last: Floats, radius: int) -> Floats:
    """[radius, axes] rows that follow the `last` three rows of angles."""
    if len(last) < 3:
        return np.repeat(last[-1:], radius, axis=0)
    speed = np.diff(last, axis=0)
    rows = np.arange(radius)[:, None]
    steps = speed[1] + (np.minimum(rows, _STEADY_ROWS - 1) + 1) * (speed[1] - speed[0])
    steps = np.where((np.abs(speed[1]) > _RESTS) & (steps * speed[1] > 0.0), steps, 0.0)  # it stops rather than turn
    return np.asarray(last[-1] + np.cumsum(steps * _FADES ** np.maximum(rows - _STEADY_ROWS + 1, 0), axis=0))


def derivatives(q: Floats, step_s: float) -> tuple[Floats, Floats]:
    """Velocity [rad/s] and acceleration [rad/s^2], both [T, axes], of angles [T + 2, axes] by central differences."""
    before, here, after = q[:-2], q[1:-1], q[2:]
    return (after - before) / (2 * step_s), (after - 2 * here + before) / step_s**2


def motion(q: Floats, step_s: float) -> tuple[Floats, Floats, Floats]:
    """q, qd and qdd, each [T, axes], of angles [T, axes], which may begin and end in motion."""
    return (q, *derivatives(continued(q, 1), step_s))
